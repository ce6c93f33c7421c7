"""Functions that are compiled to machine code: `kernels` has their decorator, `ahead` compiles those of a tracker at once."""
