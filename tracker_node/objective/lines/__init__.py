"""Region modality: correspondence lines along the normals of contour samples, and the colors on them.

Begin with `correspondences` (all cameras), then `camera` (one camera, one call) and `correspondence` (one line); `table` names
the columns of the arrays that the kernels share.
"""
