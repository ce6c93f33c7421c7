"""Camera rigs in our format and other programs': lenses, places, control points.

Begin with `rig_yaml`, our own format; `formats` tells which program has written a calibration.
"""
