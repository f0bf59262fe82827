"""How `make docs` builds docs/_build/html. Nothing is fetched, neither by the build nor by a browser."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import gallery_figures

import softstart

project = "softstart"
author = "The softstart developers"
project_copyright = author
version = release = softstart.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_gallery.gen_gallery",
    "sphinx_copybutton",
    "mathml",  # the five below are in _ext
    "house_docstrings",
    "further_reading",
    "generated_pages",
    "public_names",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
root_doc = "index"
exclude_patterns = ["_build", "gallery"]
nitpicky = True
default_role = "house"
highlight_language = "none"
smartquotes = False  # help texts and docstrings hold things to be typed: shaft.gap='2 rad'
suppress_warnings = ["toc.empty_glob", "config.cache"]

# ---- Markdown
myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence", "attrs_inline", "attrs_block"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

# ---- docstrings
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {
    name: name for name in ("Vector", "Matrix", "Value", "Quantity", "ArrayLike", "Progress")
}
autosummary_generate = False
add_module_names = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 78
toc_object_entries_show_parents = "hide"

# ---- gallery
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "gallery_pages",
    "filename_pattern": r"plot_",
    "within_subsection_order": "gallery_figures.Order",
    "image_scrapers": (gallery_figures.scraper,),
    "capture_repr": (),
    "reset_modules": (),
    "plot_gallery": os.environ.get("GALLERY") != "0",
    "abort_on_example_error": False,
    "only_warn_on_example_error": False,
    "download_all_examples": False,
    "show_signature": False,
    "min_reported_time": 0,
    "show_memory": False,
    "write_computation_times": False,
    "remove_config_comments": True,
    "notebook_images": False,
    "show_api_usage": False,
    "default_thumb_file": None,
}

# ---- HTML
html_theme = "furo"
html_title = f"softstart {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#0072B2",
        "color-brand-content": "#00629b",
        "font-stack--monospace": "ui-monospace, SFMono-Regular, Menlo, 'DejaVu Sans Mono', monospace",
    },
    "dark_css_variables": {"color-brand-primary": "#56B4E9", "color-brand-content": "#7cc5ee"},
}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
