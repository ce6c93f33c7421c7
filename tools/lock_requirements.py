"""Write the exact versions of this environment into requirements/.

Run it with the Python of an environment that works, after changing a direct requirement there:

    .venv/bin/python tools/lock_requirements.py

requirements/runtime.txt gets what the package needs to run, studio and detector of people included, and on top of it
ros.txt gets ROS itself (not wanted where ROS comes from apt), build.txt what building the two packages needs and test.txt
what the checks need, with the extras for H5, tables, clusters, sound, Rerun and OpenSim, docs.txt what the site needs. The direct
requirements are in setup.py and msgs/pyproject.toml.
"""

import ast
import re
import tomllib
from importlib.metadata import Distribution, distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEADER = "# Written by tools/lock_requirements.py from setup.py and msgs/pyproject.toml.\n"
KINDS = {  # file -> lists of setup.py, without _REQUIREMENTS
    "runtime": ("RUNTIME", "STUDIO", "KEYPOINTS"),
    "ros": ("ROS",),
    "build": ("BUILD",),
    "test": ("TEST", "H5", "DATA", "CLUSTER", "SOUND", "RERUN", "OPENSIM"),
    "docs": ("DOCS",),
}
OWN = {"tracker-node", "tracker-msgs"}
NAME = re.compile(r"^([A-Za-z0-9._-]+)(?:\[([^\]]*)\])?")


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def installed() -> dict[str, Distribution]:
    """The distributions that pip installed; ROS wheels carry foreign metadata beside their own."""
    return {canonical(d.metadata["Name"]): d for d in distributions() if d.read_text("RECORD") is not None}


def direct_requirements() -> dict[str, list[str]]:
    """The requirement lists of setup.py by their variable names."""
    tree = ast.parse((ROOT / "setup.py").read_text())
    return {
        node.targets[0].id: ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and node.targets[0].id.endswith("_REQUIREMENTS")
    }


def closure(requirements: list[str], available: dict[str, Distribution]) -> set[str]:
    """Every installed distribution that the requirements need, themselves included."""
    found: set[str] = set()
    seen: set[str] = set()
    pending = list(requirements)
    while pending:
        requirement = pending.pop()
        if requirement in seen:
            continue
        seen.add(requirement)
        match = NAME.match(requirement)
        if match is None or canonical(match[1]) not in available:
            continue
        name = canonical(match[1])
        extras = {canonical(extra.strip()) for extra in (match[2] or "").split(",") if extra.strip()}
        found.add(name)
        for needed in available[name].requires or []:
            wanted_by = re.search(r"extra\s*==\s*['\"]([^'\"]+)['\"]", needed)
            if wanted_by is None or canonical(wanted_by[1]) in extras:
                pending.append(needed)
    return found - OWN


def main() -> None:
    available = installed()
    direct = direct_requirements()
    build_system = tomllib.loads((ROOT / "msgs" / "pyproject.toml").read_text())["build-system"]
    direct["BUILD_REQUIREMENTS"] = ["setuptools", "wheel", *build_system["requires"]]
    files: dict[str, set[str]] = {}
    for kind, lists in KINDS.items():
        listed = set().union(*files.values())
        needed = [requirement for name in lists for requirement in direct[f"{name}_REQUIREMENTS"]]
        files[f"{kind}.txt"] = closure(needed, available) - listed
    for file, names in files.items():
        lines = [f"{name}=={available[name].version}\n" for name in sorted(names)]
        (ROOT / "requirements" / file).write_text(HEADER + "".join(lines))
        print(f"requirements/{file}: {len(names)}")
    left_over = sorted(set(available) - set().union(*files.values()) - OWN - {"pip"})
    print(f"installed, but needed by none: {', '.join(left_over) or 'nothing'}")


if __name__ == "__main__":
    main()
