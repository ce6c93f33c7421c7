"""Colors that stay distinct for color-blind readers (Okabe and Ito), and those of ink."""

BLUE, ORANGE, GREEN, RED, PURPLE, GREY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#777777"
SKY = "#56b4e9"
CYCLE = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, "#999933", GREY)
BLACK = "#1d2730"
