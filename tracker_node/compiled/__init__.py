"""Functions that are compiled to machine code.

Begin with `kernels`, which has their decorator; `ahead` compiles those of a usual tracker on all processors.
"""
