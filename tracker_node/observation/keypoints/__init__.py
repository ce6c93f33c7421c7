"""Learned points and silhouettes of people: a network's joints in one image, with their covariances.

What the points say of a body in a state is the matter of `objective.keypoints`; files of other detectors are read by
`loaders.keypoints`. Begin with `people` (the values), then `blazepose` (the network that is used by default).
"""
