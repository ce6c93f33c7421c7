"""Articulated bodies: links, joints, shapes, landmarks, and a body in a state.

Files of bodies are read in `loaders.model`; what a camera sees of a body is the matter of `render`. Begin with `articulated`
(`ArticulatedModel`), then `kinematic_chain` and `configuration` (`State`, `Configuration`).
"""
