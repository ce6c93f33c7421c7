"""Where synthetic subjects are filmed: rooms, clutter, cameras, imaging, and the renderer.

Begin with `scene`.
"""
