"""Tracking by regions, the default: fit of correspondence lines, search for lost limbs, confidence in limbs.

Begin with `engine`; `limb_status` decides that a limb is lost, `searches` what is done about it.
"""
