"""Markerless model-based 3D motion tracking for ROS 2.

`__all__` is what is kept stable from version to version; each name is imported when it is first used. Begin with `api`.
"""

import importlib
import importlib.util
import os
import sys
from typing import TYPE_CHECKING, Any

from .version import __version__

if TYPE_CHECKING:
    from .api.functions import evaluate, export, track, track_bodies
    from .api.recording import Recording, open_bodies, open_recording
    from .api.run import Run, load_run
    from .errors import TrackerError
    from .loaders.model.model_yaml import load_model
    from .loaders.model.state_yaml import load_state
    from .loaders.rig.rig_yaml import load_rig
    from .model.configuration import State
    from .observation.image_set import CameraImage, ImageSet
    from .runs.config_file import load_config
    from .tracking.config import TrackerConfig
    from .tracking.tracker import Tracker

__all__ = [
    "CameraImage",
    "ImageSet",
    "Recording",
    "Run",
    "State",
    "Tracker",
    "TrackerConfig",
    "TrackerError",
    "__version__",
    "evaluate",
    "export",
    "load_config",
    "load_model",
    "load_rig",
    "load_run",
    "load_state",
    "open_bodies",
    "open_recording",
    "track",
    "track_bodies",
]
_MODULES = {  # name -> module that has it
    "CameraImage": "observation.image_set",
    "ImageSet": "observation.image_set",
    "Recording": "api.recording",
    "Run": "api.run",
    "State": "model.configuration",
    "Tracker": "tracking.tracker",
    "TrackerConfig": "tracking.config",
    "TrackerError": "errors",
    "evaluate": "api.functions",
    "export": "api.functions",
    "load_config": "runs.config_file",
    "load_model": "loaders.model.model_yaml",
    "load_rig": "loaders.rig.rig_yaml",
    "load_run": "api.run",
    "load_state": "loaders.model.state_yaml",
    "open_bodies": "api.recording",
    "open_recording": "api.recording",
    "track": "api.functions",
    "track_bodies": "api.functions",
}


def __getattr__(name: str) -> Any:
    """A name of `__all__`, from its module (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


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
