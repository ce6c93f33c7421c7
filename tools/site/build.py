"""Build the site: pages, API reference, search (`make docs`).

    python tools/site/build.py --output out/docs

The pages are copied beside generated ones of the API, one for each package, so that nothing is written into docs/. A link that
leads nowhere fails the build. ``--api`` names the package that is documented; empty, there is no reference.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from sphinx.cmd.build import main as sphinx

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
NAVIGATION = {  # a page that is not named here fails the build
    "Begin": ("install", "tutorial", "own_data"),
    "Set up": ("cameras", "bodies", "tracking", "studio"),
    "Run": ("nodes", "results", "trust", "troubleshooting"),
    "Look up": ("formats", "measured", "roofline", "reproduce"),
    "Develop": ("architecture", "development", "roadmap", "api/index"),
}
LEFT_OUT = ("ros", "cli")  # nodes and commands have documentation of their own, and nodes need ROS
MODULE = ".. automodule:: {}\n"
ONCE = "   :ignore-module-all:\n"  # what a package takes from its modules is described there


def packages(top: str) -> dict[str, list[str]]:
    """Public modules of each package at or below ``top``, by the package's full name, which comes first among them."""
    found: dict[str, list[str]] = {}
    for folder in sorted(path.parent for path in ROOT.joinpath(*top.split(".")).rglob("__init__.py")):
        parts = folder.relative_to(ROOT).parts
        if (parts[1:2] and parts[1] in LEFT_OUT) or any(part.startswith("_") for part in parts):
            continue
        name = ".".join(parts)
        modules = sorted(path.stem for path in folder.glob("*.py") if not path.stem.startswith("_"))
        found[name] = [name, *(f"{name}.{module}" for module in modules)]
    return found


def write_reference(folder: Path, top: str) -> None:
    """``api/index.rst`` with the packages, and a page for each of them; without ``top`` the first alone, which says so."""
    folder.mkdir()
    listed = packages(top) if top else {}
    lines = [_heading("API", "="), "Classes and functions by package.\n", ".. toctree::\n   :maxdepth: 1\n"]
    lines += [f"   {name}" for name in listed]
    (folder / "index.rst").write_text("\n".join(lines) + "\n", encoding="utf-8")
    for name, modules in listed.items():
        below = [other for other in listed if other.rpartition(".")[0] == name]
        text = [_heading(name, "="), MODULE.format(name) + (ONCE if "." in name else "")]
        text += ["Packages in it: " + ", ".join(f":doc:`{other}`" for other in below) + ".\n"] if below else []
        for module in modules[1:]:
            text += [_heading(module.removeprefix(f"{name}."), "-"), MODULE.format(module)]
        (folder / f"{name}.rst").write_text("\n".join(text), encoding="utf-8")


def write_navigation(index: Path) -> None:
    """Append the tables of contents to the first page, hidden in the text: they make the sidebar."""
    with index.open("a", encoding="utf-8") as file:
        for caption, pages in NAVIGATION.items():
            file.write("\n".join(["", "```{toctree}", ":hidden:", f":caption: {caption}", *pages, "```", ""]))


def _heading(text: str, line: str) -> str:
    return f"{text}\n{line * len(text)}\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "out/docs", metavar="FOLDER", help="default: out/docs")
    parser.add_argument("--api", default="tracker_node", metavar="PACKAGE", help="default: %(default)s")
    args = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        source = Path(temporary) / "docs"
        shutil.copytree(ROOT / "docs", source)
        write_navigation(source / "index.md")
        write_reference(source / "api", args.api)
        options = ["-b", "html", "-q", "-W", "--keep-going", "-E", "-c", str(HERE), "-d", str(Path(temporary) / "doctrees")]
        return sphinx([*options, str(source), str(args.output)])


if __name__ == "__main__":
    sys.exit(main())
