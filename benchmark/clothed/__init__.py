"""Recordings of clothed people with exact truth, drawn by seed: other bodies, clothes, rooms and motions than those of synthesis.

Begin with `draw_clips`, the program; `_traits` says what a seed decides.
"""
