"""The page on which a body is posed by hand: sliders, mouse, score, fit.

Begin with `page`.
"""
