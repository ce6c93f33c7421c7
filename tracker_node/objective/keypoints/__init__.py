"""Detected points compared with the landmarks of a body.

What a detector finds is in `observation.keypoints`; who stands in which image, and how detections are followed, in
`tracking.keypoints`. Begin with `correspondences`.
"""
