"""The default renderer: rays of a camera against shapes in closed form, in vector instructions.

Triangles by OpenGL are in `render.opengl`. Begin with `raycaster`; `coefficients` has the mathematics, `kernels` the pixel loops,
`shading` surfaces and light.
"""
