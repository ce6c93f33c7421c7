"""Bodies and first poses as files: our YAML, URDF, meshes.

Begin with `model_yaml` and `state_yaml`.
"""
