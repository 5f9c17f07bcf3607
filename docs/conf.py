"""Configuration of the site, built without a network by `sphinx-build -W -b html docs build/site`."""

from __future__ import annotations

import sys
from importlib.metadata import metadata
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util.inspect import TypeAliasForwardRef

sys.path.insert(0, str(Path(__file__).parent))

from docstring_text import constant_text, restructured

from dynx._version import DISTRIBUTION

_package = metadata(DISTRIBUTION)
project = "dynx"
author = "the developers of dynx"
copyright = "the developers of dynx"
release = version = _package["Version"]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "command_help",
    "math_markup",
    "tutorial_downloads",
]
exclude_patterns = ["schemas"]
default_role = "py:obj"
html_math_renderer = "mathml"
maximum_signature_line_length = 80

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 4
myst_heading_slug_func = "heading_anchors.anchor"

autodoc_default_options = {"members": True, "member-order": "bysource", "no-value": True}
autoclass_content = "both"
autodoc_mock_imports = ["torch", "stable_baselines3", "tensorboard"]
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Floats", "Array", "Batch")}
TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # shown in the types of properties

copybutton_prompt_text = "$ "
copybutton_only_copy_prompt_lines = True

html_theme = "furo"
html_title = f"dynx {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_theme_options = {"top_of_page_buttons": ["view"]}
for _entry in _package.get_all("Project-URL") or []:
    _label, _, _address = _entry.partition(", ")
    if _label == "Repository":
        html_theme_options |= {
            "source_repository": _address,
            "source_branch": "main",
            "source_directory": "docs/",
            "top_of_page_buttons": ["view", "edit"],
        }


def _restructure(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    lines[:] = restructured(constant_text(name, obj) if what == "data" else lines)


def setup(app: Sphinx) -> None:
    """Have the docstrings of dynx translated."""
    app.connect("autodoc-process-docstring", _restructure)
