"""How well a body in a state agrees with the images: scores, and least-squares problems with analytic derivatives.

An objective knows one state and the evidence, and no time; fitting is in `optimize` and `tracking`. Begin with `normal_equations`
(what every least-squares objective gives), then `lines.correspondences`, which tracks by default.
"""
