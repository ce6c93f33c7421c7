"""Lenses and places of cameras from a calibration board.

Begin with `rig`: from recordings to cameras; `board` finds corners, `adjustment` is the bundle adjustment.
"""
