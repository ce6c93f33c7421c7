"""The site of ``make docs``: the pages of docs/, and an API reference from the docstrings; Sphinx runs this file.

``TRACKER_DOCS_API`` names the package to be documented (default: the whole); empty, there is none. Nodes and commands have
documentation of their own, and are left out.
"""

import os
import sys
import warnings
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
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
exclude_patterns = ["images"]
default_role = "code"
myst_heading_anchors = 4
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
suppress_warnings = ["autodoc", "docutils", "ref.python", "myst.header", "myst.highlighting"]  # links of pages are not among them
warnings.filterwarnings("ignore")
