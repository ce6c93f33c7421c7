"""Chamfer modality: distances of predicted contour samples to edges and silhouettes (Knossow et al.).

Begin with `correspondences`; the residuals' kernels are in `objective.contour_residual`.
"""
