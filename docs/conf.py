"""The site: pages of this folder, the notebooks as they ran, and the API from docstrings. `make docs` builds it."""

from __future__ import annotations

import sys
from pathlib import Path

import trajopt

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "trajopt"
release = trajopt.__version__
copyright = "the trajopt developers"
html_theme = "furo"
html_title = "trajopt"
extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinx_copybutton", "problem_keys", "command_help",
]  # fmt: skip
exclude_patterns = ["build.py", "extensions"]
nb_execution_mode = "off"  # docs/build.py ran them before
nb_render_markdown_format = "myst"
myst_enable_extensions = ["dollarmath", "attrs_block"]
myst_heading_anchors = 3
autodoc_typehints = "description"
autodoc_member_order = "bysource"
default_role = "code"
suppress_warnings = ["mystnb.unknown_mime_type"]
copybutton_prompt_text = "$ "
