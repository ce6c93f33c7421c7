"""Evidence for the chamfer modality: distance maps of silhouette and edges around the expected body.

Begin with `observer`, one camera's evidence from image to maps; the residuals on these maps are in `objective.chamfer`.
"""
