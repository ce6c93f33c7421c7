"""People in the images of offline runs: found by a detector before each step, as a bag holds them, or from any detector's files.

What a message says of people is in `runs.messages`, and which of it a tracker uses; detectors themselves are in
`observation.keypoints`. Begin with `detection`.
"""
