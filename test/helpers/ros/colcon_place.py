"""colcon in a Python that has nothing else: as on a machine where it comes from apt, and the packages from an environment."""

import importlib.metadata
import re
import subprocess
import sys
from pathlib import Path


def bare_python_with(packages: list[str], folder: Path, source: Path) -> Path:
    """A new environment in ``folder`` that has only these packages of the site-packages ``source``, and what they need.

    Returns its interpreter. Nothing is fetched: the packages are links.
    """
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    (target,) = folder.glob("lib/python*/site-packages")
    known = {_plain(d.metadata["Name"]): d for d in importlib.metadata.distributions(path=[str(source)])}
    wanted, taken = list(packages), set()
    while wanted:
        name = _plain(wanted.pop())
        if name in taken or name not in known:
            continue
        taken.add(name)
        wanted += [re.split(r"[^\w.-]", text)[0] for text in known[name].requires or () if "extra ==" not in text]
        for part in {file.parts[0] for file in known[name].files or () if not file.parts[0].startswith(".")}:
            if part != "__pycache__" and not (target / part).exists() and (source / part).exists():
                (target / part).symlink_to(source / part)
    return folder / "bin" / "python3"


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
