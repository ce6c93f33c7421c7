"""A second renderer: triangles drawn by OpenGL through pyrender, to check the first and to make independent truth.

Begin with `renderer`; `tessellation` turns shapes into triangles.
"""
