"""Scores of many poses by the area that a body or a part of it covers on small images: what searches begin with.

Begin with `score` (`AreaScore`); `maps` says how much the color of a pixel speaks for a part, `visual_hull` where a body may be.
"""
