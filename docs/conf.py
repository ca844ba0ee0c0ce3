"""Sphinx's configuration; docs/site_pages.py gathers the sources."""

from psdmc.version import VERSION

project = "psdmc"
author = "the psdmc authors"
release = VERSION
html_title = f"psdmc {VERSION}"
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css", "tables.css"]
html_js_files = ["site.js", "tables.js"]
html_show_copyright = False
extensions = ["myst_parser", "sphinx_copybutton"]
myst_heading_anchors = 4
copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True
suppress_warnings = ["misc.highlighting_failure"]
