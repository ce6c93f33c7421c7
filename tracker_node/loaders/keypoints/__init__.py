"""Points of other detectors, from their files: each module knows one format, and gives the people in each camera's images.

Detectors that run here are in `observation.keypoints`; which landmarks of a body points are says `table`, a file of the user, or
`model.humans.keypoints`. Begin with `camera_people` (the values), then `formats`, which knows a format when it sees it.
"""
