"""Settings of the documentation; `make docs` builds it, without a network."""

from __future__ import annotations

import sys
from pathlib import Path

from triaxcal import __version__

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "triaxcal"
author = "the triaxcal authors"
project_copyright = "the triaxcal authors, MIT licence"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "numpydoc",
    "external_links",
    "lengths",
]
# Pages that moved: generated C, the DBC and unit.toml of 0.1.0 name the old places.
MOVED = ["can.md", "file-formats.md", "fixed-point.md", "targets.md"]
exclude_patterns = ["_build", "_ext", *MOVED]
source_suffix = {".md": "markdown"}

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4

default_role = "code"  # of docstrings
nitpicky = True
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
autodoc_typehints = "none"  # the docstrings give shapes and units, which types do not

html_theme = "furo"
html_title = f"triaxcal {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
