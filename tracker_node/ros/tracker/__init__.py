"""The tracker as a node: images in, estimates out, parameters, services, diagnostics.

Begin with `node`, then `worker`, the thread in which images become estimates.
"""
