"""Evidence for the region modality: densities of color of the body's parts and of what surrounds them.

Begin with `colors`; the correspondence lines that read these densities are in `objective.lines`.
"""
