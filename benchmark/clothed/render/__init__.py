"""A renderer that is not the tracker's: the room by rays, people by triangles, shadows of both.

Begin with `_people`.
"""
