"""Settings of the manual: `python -m sphinx -W -b html docs outputs/manual`, in the project's folder.

Pages that repeat what the program itself knows (scene keys, command line, equations, verification) are written into
``docs/generated`` by the modules of ``docs/generate`` before anything is read. The tutorials are run by sphinx-gallery.
"""

import logging
import os
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from generate import pages
from generate.docstrings import as_rst
from generate.pictures import RunPictures

import geomech

project = "geomech"
author = "The authors of geomech"
project_copyright = "The authors of geomech, GPL-3.0-or-later"
version = release = geomech.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "sphinx-mathjax-offline",
]
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3
exclude_patterns = [
    "generated/two_cracks_table.md",
    "generate/**",
    "tutorials/**",
    "gallery/**/*.ipynb",
    "gallery/**/*.py",
    "**/README.txt",
]
# Topics beside the chapters may have been written or not: `howto/index` lists what there is.
suppress_warnings = ["config.cache"]
# Which kernels were compiled is of the machine that builds, not of the tutorials.
logging.getLogger("geomech.compiled").addFilter(lambda record: record.levelno > logging.DEBUG)
logging.getLogger("sphinx.sphinx.directives.other").addFilter(lambda record: "glob pattern" not in str(record.msg))

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_class_signature = "mixed"

html_theme = "pydata_sphinx_theme"
html_title = "geomech"
html_show_sourcelink = False
html_copy_source = False
# Excerpts are fetched from other pages, which a browser refuses where pages are files.
html_show_search_summary = False
html_static_path = ["static"]
html_css_files = ["manual.css"]
html_logo = "static/logo.svg"
html_favicon = "static/logo.svg"
html_theme_options = {
    "logo": {"text": "geomech"},
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "navbar_persistent": ["search-button"],
    "header_links_before_dropdown": 7,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
    "pygments_dark_style": "github-dark",
}
html_sidebars = {"index": [], "search": []}
html_context = {"default_mode": "auto"}
copybutton_prompt_text = "$ "

# `-D plot_gallery=False` builds without running the tutorials; text, as what a command line gives.
plot_gallery = "True"
sphinx_gallery_conf = {
    "examples_dirs": "tutorials",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": (RunPictures(), "matplotlib"),
    "capture_repr": (),
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_memory": False,
    # That page fetches its table from elsewhere.
    "write_computation_times": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "abort_on_example_error": True,
    "thumbnail_size": (480, 320),
}


def setup(app):
    # Kernels are kept where they always are; runs of tutorials go to a folder that goes with the build.
    tempfile.tempdir = None
    app.connect(
        "autodoc-process-docstring",
        lambda app, what, name, it, options, lines: lines.__setitem__(slice(None), as_rst(lines)),
    )
    app.connect("config-inited", lambda app, config: pages.write_all(HERE / "generated"))
