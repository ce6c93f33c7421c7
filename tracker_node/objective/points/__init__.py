"""Points of a body's surface against images: their colors, and the textures of faces.

Begin with `texture` for textured objects, with `photometry` for the colors of surface points.
"""
