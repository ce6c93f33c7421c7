"""Cameras, bodies, backgrounds, lights and first poses from recordings.

Reading and writing of their files is in `loaders`. Begin with `board.rig` (cameras from a board), `body` (a person's body) and
`background`.
"""
