"""Contours as in Knossow, Ronfard, Horaud & Devernay: errors along variables, the sliding term, images.

Begin with `experiment`.
"""
