"""Recorded and live images: videos, folders, bags, devices, streams; stamps and backgrounds.

Begin with `source` (recorded images by the name of their source) and `feed` (several sources on one clock).
"""
