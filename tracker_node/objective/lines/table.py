"""Columns of the arrays of correspondence lines."""

# Columns of a line: point in the link's frame, pixel and normal of the sample when the line was drawn, how far out the contour is
# (mean, px) with its precision (1/variance, px^-2), log-likelihood of a contour near there against none on the line
POINT, LINE_U, LINE_V, LINE_NU, LINE_NV, MEAN, PRECISION, LOG_RATIO = 0, 3, 4, 5, 6, 7, 8, 9
N_LINE_COLUMNS = 10
# Columns of the plan of a line: color classes of its part and of the part behind (-1: none), how many pixels are read before the
# places where the contour may be (-1: no colors are read), how wide the part is there (places of the line)
OWN, BEHIND, BEFORE, WIDTH = range(4)
N_PLAN_COLUMNS = 4
LONGEST = 96  # pixels of a line
SHARP = 0.3  # px^-2: lines more precise than that are refined, and used to estimate how well the model fits
