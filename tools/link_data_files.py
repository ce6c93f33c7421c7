"""Link the data files of setup.py into this environment, which an editable installation by pip leaves out.

    .venv/bin/python tools/link_data_files.py

What `colcon build --symlink-install` does: share/tracker_node and lib/tracker_node follow the source tree.
"""

import os
import sys
from pathlib import Path

import setuptools

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "tracker_node"


def data_files() -> list[tuple[str, list[str]]]:
    os.chdir(ROOT)
    # Importing setuptools brings its distutils, also where Python has none.
    return setuptools.distutils.core.run_setup("setup.py", stop_after="init").data_files


def remove_old_links(prefix: Path) -> None:
    """Forget files that are no longer in the source tree."""
    for folder in (prefix / "share" / PACKAGE, prefix / "lib" / PACKAGE):
        for path in sorted(folder.rglob("*"), reverse=True):
            if path.is_symlink():
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()


def main() -> None:
    prefix = Path(sys.prefix)
    if prefix == Path(sys.base_prefix):
        sys.exit("this is not the Python of a virtual environment")
    remove_old_links(prefix)
    for folder, files in data_files():
        (prefix / folder).mkdir(parents=True, exist_ok=True)
        for file in files:
            link = prefix / folder / Path(file).name
            link.unlink(missing_ok=True)
            link.symlink_to(ROOT / file)


if __name__ == "__main__":
    main()
