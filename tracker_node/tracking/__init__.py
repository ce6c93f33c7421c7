"""From an image set to an estimate: engines, initialization, motion, covariance, status.

Files and ROS are elsewhere (`loaders`, `runs`, `ros`). Begin with `tracker` (`Tracker.step` is the whole core in one call), then
`engine` (modalities, a solver, a judge) and `engines` (which there are); `config` holds every parameter.
"""
