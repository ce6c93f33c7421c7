"""Chamfer modality: distances of predicted contour samples to edges and silhouettes (Knossow et al.).

Begin with `objective`; the residuals' kernels are in `objective.contour_residual`.
"""
