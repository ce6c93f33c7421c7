"""Clocks of cameras that run freely, from what moves in their images.

Begin with `offsets`.
"""
