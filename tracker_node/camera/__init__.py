"""Cameras: lenses, places in the world, lights, how images are taken.

Files of cameras are read in `loaders.rig`, and calibration computes them in `calibration`. Begin with `rig` (`Camera`,
`CameraRig`), then `model` (`CameraModel`: projection and its derivatives).
"""
