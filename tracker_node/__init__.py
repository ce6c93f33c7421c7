"""Markerless model-based 3D motion tracking for ROS 2."""

import os

__version__ = "0.1.0"


def _use_whole_vectors() -> None:
    """Let numba use 512-bit vectors where the processor has them.

    By default LLVM keeps to half of their width on many processors, for fear of lower clock rates; pixel loops with hundreds of
    instructions are nearly twice as fast with the whole. To be done before numba is imported; NUMBA_CPU_FEATURES overrides it.
    """
    if "NUMBA_CPU_FEATURES" not in os.environ:
        import llvmlite.binding

        features = llvmlite.binding.get_host_cpu_features()
        if features.get("avx512f"):
            os.environ["NUMBA_CPU_FEATURES"] = f"{features.flatten()},-prefer-256-bit"


_use_whole_vectors()
