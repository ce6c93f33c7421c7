"""Colors and contours together: one after the other, or in one least-squares problem.

Begin with `color_with_contour`.
"""
