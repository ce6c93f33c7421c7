"""The first pose: where a body is in images, without any hint.

Begin with `initializer` (from images to a state to track from) and `detector` (from coarse to fine); the other modules are its
stages.
"""
