"""Sphinx's settings for the site; `stage.py` writes its sources and calls it."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from saltus import __version__

project = "saltus"
author = "The saltus developers"
copyright = "The saltus developers"
version = release = __version__
language = "en"

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "formulas",
    "names",
]
templates_path = ["templates"]
default_role = "py:obj"
nitpicky = False  # a name in single quotation marks may be an argument; `names` links those that are public
exclude_patterns = ["files/**"]

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 6
myst_dmath_double_inline = True

autosummary_generate = False  # `stage` writes the pages
autodoc_typehints = "none"
autodoc_preserve_defaults = True
numpydoc_show_class_members = True
numpydoc_show_inherited_class_members = True
numpydoc_class_members_toctree = False
numpydoc_xref_param_type = False

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

html_theme = "pydata_sphinx_theme"
html_title = f"saltus {version}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "saltus"},
    "icon_links": [],
    "navbar_end": ["version-switcher", "theme-switcher"],
    "switcher": {"json_url": "switcher.json", "version_match": version},
    "check_switcher": False,
    "secondary_sidebar_items": ["page-toc", "edit-this-page"],
    "use_edit_page_button": True,
    "show_nav_level": 1,
    "navigation_depth": 3,
    "header_links_before_dropdown": 6,
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_context = {"default_mode": "auto"}
