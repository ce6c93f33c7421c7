"""People: skinned bodies, their poses, motions and clothes.

Begin with `_body`. `_write_bodies` is a program that runs in an environment of its own.
"""
