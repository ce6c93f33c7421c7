"""The detector of people as a node: images in, points and silhouettes out, at its own rate.

What becomes of the points in a tracker is in `ros.tracker`; the networks are in `observation.keypoints`. Begin with `node`.
"""
