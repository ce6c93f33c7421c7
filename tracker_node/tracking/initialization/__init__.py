"""The first pose: where a body is in images that nobody has told anything about.

Begin with `initializer` (from images to a state to track from) and `detector` (from coarse to fine); the other modules are its
stages.
"""
