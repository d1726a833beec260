"""Configuration of the site, which `python3 build.py docs` builds with Sphinx.

Sphinx with MyST and Furo was chosen rather than MkDocs with Material, since it reads the docstrings
of the API, checks every link and reference between pages, and builds without a network.
"""

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "kernels")]
_manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))

project = _manifest["name"]
author = _manifest["maintainer"]
copyright = f"2026 {author}, GPL-3.0-or-later"  # noqa: A001 (Sphinx's name)
release = version = _manifest["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["gallery/*.py", "examples"]
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

autodoc_typehints = "none"  # the docstrings give the types with shapes
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"{project} {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
