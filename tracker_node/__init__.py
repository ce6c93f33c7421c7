"""Markerless model-based 3D motion tracking for ROS 2."""

import importlib.util
import os
import sys

__version__ = "0.1.0"


def _use_whole_vectors() -> None:
    """Let numba use 512-bit vectors where the processor has them.

    By default LLVM keeps to half of their width on many processors, for fear of lower clock rates; pixel loops with hundreds of
    instructions are nearly twice as fast with the whole. To be done before numba is imported; NUMBA_CPU_FEATURES overrides it.
    The Python of `ros2 launch`, which imports this for the launch files, need not have numba.
    """
    if "NUMBA_CPU_FEATURES" not in os.environ and importlib.util.find_spec("llvmlite"):
        import llvmlite.binding

        features = llvmlite.binding.get_host_cpu_features()
        if features.get("avx512f"):
            os.environ["NUMBA_CPU_FEATURES"] = f"{features.flatten()},-prefer-256-bit"


def _use_one_blas_thread() -> None:
    """Let linear algebra run on the thread that asks for it; OPENBLAS_NUM_THREADS overrides it.

    Our matrices have some tens of rows. OpenBLAS shares even those out, and waiting for its threads costs a thousand times
    what the sum does (a triangular solve of 12 x 12: 15 us alone, 8 ms shared out, on a busy machine). The variable is read
    when it is loaded; where it has been before us, with numpy, it is told.
    """
    if "OPENBLAS_NUM_THREADS" in os.environ:
        return
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    if "numpy" in sys.modules and importlib.util.find_spec("threadpoolctl"):
        import threadpoolctl

        threadpoolctl.threadpool_limits(1, user_api="blas")


def _refuse_huge_images() -> None:
    """Let OpenCV refuse images of more than 134 megapixels; OPENCV_IO_MAX_IMAGE_PIXELS overrides it.

    By default it decodes up to 1074, and a damaged header of a JPEG image that came by the network costs gigabytes and
    half a minute. To be done before it is loaded.
    """
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(2**27))


_use_whole_vectors()
_use_one_blas_thread()
_refuse_huge_images()
