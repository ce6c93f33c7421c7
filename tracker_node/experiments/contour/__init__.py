"""Contours as in Knossow, Ronfard, Horaud & Devernay: errors along variables, the sliding term, pictures.

Begin with `experiment`.
"""
