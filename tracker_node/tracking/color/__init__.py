"""Tracking by colors (Trewartha, Yeadon & Knight) and by textures of faces.

Begin with `modality` and `search`; `over_background` explains the whole image, `texture` tracks textured objects.
"""
