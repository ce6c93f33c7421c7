"""What cameras see of a posed body: pixels, contour samples, overlays.

Nothing here reads images of the world or compares with them; that is `observation` and `objective`. Begin with `renderer` (what
every renderer gives) and `raycast.raycaster`, the default one; `contour.samples` lists the contour samples that trackers fit.
"""
