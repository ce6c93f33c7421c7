"""Who is filmed: the mannequin that is not the tracker's model, the model itself, the figure of ten cones.

Begin with `mannequin`.
"""
