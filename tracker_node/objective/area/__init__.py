"""Scores of many poses by the area that a body or limb covers on small images: what searches begin with.

Begin with `evidence_score` (whole bodies) and `limb_score` (one limb, the rest as it is).
"""
