"""Cameras that are not to be trusted, told while tracking.

Begin with `trust`, which leaves them out. `frozen` knows those that repeat an image, `blinded` those that do not show the body,
`bumped` those whose picture of the room has turned, `delayed` those that show another moment; `self_check` names those whose
contours contradict the others'.
"""
