"""Cameras that are not to be trusted, told while tracking.

Begin with `self_check`, which names those whose contours contradict the others'. `frozen` leaves out those that repeat an image,
`blinded` those that do not show the body.
"""
