"""The documentation site: pages in Markdown, notebooks as they are, reference pages from the code itself.

`make docs` builds it with every warning an error. It loads nothing from a network, neither when it is built
nor when it is read: equations are drawings within the page.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "extensions"), str(HERE.parent)]

project = "forceid"
author = copyright = "the forceid developers"
html_title = "forceid"

extensions = ["myst_nb", "sphinx.ext.autodoc", "equations", "plain_docstrings", "generated"]
exclude_patterns = ["_build", "conf.py", "picture.py", "extensions", "**/__pycache__"]

# Markdown and notebooks
smartquotes = False
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
suppress_warnings = ["myst.header", "mystnb.unknown_mime_type"]
nb_custom_formats = {".py": "gallery.read"}
nb_execution_mode = "cache"  # the tests run every notebook anyway: a build runs again what has changed
nb_execution_cache_path = str(HERE / "_build" / "executed")
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
nb_kernel_rgx_aliases = {".*": "python3"}

# Reference
autodoc_type_aliases = {
    name: name for name in ("Array", "ArrayLike", "Flags", "Indices", "Index", "Material", "Derivative")
}
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 90
add_module_names = False
toc_object_entries_show_parents = "hide"

# Pages
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}
