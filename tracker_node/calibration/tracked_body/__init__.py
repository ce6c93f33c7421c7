"""Bodies and cameras from the images of a tracked body, by its contours.

Begin with `body_fit` and `rig_fit`; `solver` is the joint least-squares problem of both.
"""
