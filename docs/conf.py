"""Sphinx's configuration: `make docs` builds the site into build/site.

Nothing is fetched, neither when the site is built nor when it is read: no outside fonts, scripts or
pictures, and mathematics is MathML. Reference pages are made from the code while it is built.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from legato import __version__  # noqa: E402

project = "legato"
version = release = __version__
language = "en"

extensions = ["myst_parser", "docs.gen.extension"]
source_suffix = {".md": "markdown"}
root_doc = "index"
exclude_patterns = ["gen", "pictures", "**/__pycache__"]
nitpicky = True
smartquotes = False  # --option stays --option

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

html_theme = "furo"
html_title = "legato"
html_static_path = ["assets"]
html_css_files = ["extra.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_show_sphinx = False
html_math_renderer = "mathml"
html_theme_options = {"footer_icons": [], "navigation_with_keys": False}
pygments_style = "xcode"
pygments_dark_style = "monokai"
