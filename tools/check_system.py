"""Look for what `make` needs from the system and name what is missing, with the line that installs it.

    python3 tools/check_system.py              # report; exit status 1 if something is missing
    python3 tools/check_system.py --packages   # only the names of the missing Debian/Ubuntu packages

Standard library only, and no newer syntax than Python 3.6: it runs before anything is installed.
"""

import ctypes
import glob
import importlib.util
import os
import shutil
import sys
import sysconfig

SUPPORTED = ((3, 11), (3, 12))


def has_library(*names):
    """Whether the dynamic loader finds one of the shared libraries."""
    for name in names:
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


def has_egl():
    """Whether EGL and a driver for it are there: Mesa's, or that of a graphics card."""
    mesa = has_library("libEGL_mesa.so.0") and any(
        glob.glob(os.path.join(root, pattern))
        for root in ("/usr/lib", "/usr/lib/*-linux-gnu")
        for pattern in ("dri/*swrast_dri.so", "libgallium-*.so")
    )
    return has_library("libEGL.so.1") and (mesa or has_library("libEGL_nvidia.so.0"))


def has_offscreen_rendering():
    if has_library("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"):
        return True
    return has_egl() and has_library("libOpenGL.so.0", "libGL.so.1")


def python_prefix():
    """Debian's name for this Python's packages: python3.12-venv, but python3-venv for the default one."""
    version = "python{}.{}".format(*sys.version_info[:2])
    default = os.path.realpath("/usr/bin/python3")
    return "python3" if os.path.basename(default) == version else version


def missing():
    """Rows of (what is missing, what it is needed for, its Debian/Ubuntu packages)."""
    if sys.version_info[:2] not in SUPPORTED:
        # No other answer about this Python matters.
        return [("Python 3.11 or 3.12", "everything (this is {}.{})".format(*sys.version_info[:2]), [])]
    rows = []
    prefix = python_prefix()
    if importlib.util.find_spec("venv") is None or importlib.util.find_spec("ensurepip") is None:
        rows.append(("the venv module", "the environment in .venv", [prefix + "-venv"]))
    if not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")):
        rows.append(("Python.h", "building the interface package", [prefix + "-dev"]))
    if not all(shutil.which(tool) for tool in ("cc", "c++")):
        rows.append(("a C and C++ compiler", "building the interface package", ["build-essential"]))
    if not has_offscreen_rendering():
        rows.append(("EGL or OSMesa", "drawing without a display", ["libegl1", "libgl1-mesa-dri", "libgl1"]))
    return rows


def has_browser():
    return any(shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome"))


def missing_extras():
    """The same for what some tests need, and nothing else: without it they are skipped."""
    return [] if has_browser() else [("Chromium", "testing pages in a real browser", ["chromium"])]


def main():
    rows = missing()
    packages = [package for row in rows for package in row[2]]
    if "--packages" in sys.argv[1:]:
        print(" ".join(packages + [package for row in missing_extras() for package in row[2]]))
        return 0
    if not rows:
        return 0
    print("Missing on this system:", file=sys.stderr)
    for what, purpose, _ in rows:
        print("  {}, for {}".format(what, purpose), file=sys.stderr)
    if packages:
        print("Install with:\n\n  sudo apt-get install -y {}\n".format(" ".join(packages)), file=sys.stderr)
    else:
        print("Install one of them, or name it: make PYTHON=/path/to/python3.12 ...", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
