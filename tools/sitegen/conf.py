"""Sphinx's settings; tools/sitegen/build.py calls it."""

project = "psabench"
html_title = "psabench"
extensions = ["myst_nb"]
root_doc = "index"
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
nb_execution_mode = "off"  # outputs are stored; tests/py/project/test_notebooks.py runs them
nb_merge_streams = True
myst_heading_anchors = 6  # the addresses that GitHub gives headings
suppress_warnings = ["misc.highlighting_failure"]  # what a command prints is no code
smartquotes = False  # quotes as they are written; a tenth of the time
html_theme = "furo"  # system fonts, nothing from the network
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
