"""Tracking by regions: fit of correspondence lines, search for lost limbs, confidence in limbs.

Begin with `modality` and `fitting`; `judge` assesses a fit, `reacquisition` finds again what is lost.
"""
