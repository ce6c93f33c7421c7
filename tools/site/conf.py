"""How Sphinx makes the site of ``make docs`` (`build.py` runs it)."""

import os
import re
import sys
from itertools import zip_longest
from pathlib import Path

os.environ["NUMBA_DISABLE_JIT"] = "1"  # kernels are functions with signatures then, and nothing is compiled
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

project = "tracker_node"
author = "tracker_node maintainers"
html_title = "tracker_node"
html_theme = "furo"
html_show_copyright = False
html_show_sourcelink = False
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["tables.css"]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
exclude_patterns = ["images"]
default_role = "code"
myst_heading_anchors = 4
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True}
add_module_names = False
maximum_signature_line_length = 100
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
suppress_warnings = ["autodoc", "docutils", "ref.python", "myst.header", "myst.highlighting"]  # links of pages are not among them

LISTS = ("Parameters", "Attributes", "Returns", "Yields", "Raises")
ITEM = re.compile(r"(\S.*?) : (\S.*)")


def texts_not_types(app, what, name, obj, options, lines: list[str]) -> None:
    """Docstrings have ``name : what it is`` on one line, types in the signature; numpydoc would take the text for a type."""
    section, changed = "", []
    for line, following in zip_longest(lines, lines[1:], fillvalue=""):  # there may be none
        if following and set(following.strip()) == {"-"}:
            section = line.strip()
        item = ITEM.fullmatch(line) if section in LISTS else None
        changed += [item[1], f"    {item[2]}"] if item else [line]
    lines[:] = changed


def setup(app) -> None:
    app.connect("autodoc-process-docstring", texts_not_types, priority=100)  # before napoleon
