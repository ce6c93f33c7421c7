"""Points and silhouettes of a detector as a modality: which person in an image is the body, points as evidence, their offsets.

Detectors themselves are in `observation.keypoints`; nothing here knows a network. Begin with `modality`.
"""
