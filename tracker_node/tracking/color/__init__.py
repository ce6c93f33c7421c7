"""Tracking by colors (Trewartha, Yeadon & Knight) and by textures of faces.

Begin with `engine`; `scene_engine` explains the whole image over a background, `texture_engine` tracks textured objects.
"""
