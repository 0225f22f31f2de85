"""Settings of Sphinx, which builds the documentation site (`make docs`)."""

import os
import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT))

from docutils import nodes  # noqa: E402
from latex2mathml.converter import convert  # noqa: E402

from app.version import __version__  # noqa: E402

project = "Slipstand"
author = project_copyright = "the Slipstand maintainers"
release = version = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "README.md", "notebooks"]
source_suffix = {".md": "markdown"}
suppress_warnings = ["myst.header", "toc.not_included"]
myst_enable_extensions = ["dollarmath", "deflist", "attrs_inline"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_class_signature = "separated"
default_role = "code"  # of docstrings
html_math_renderer = "mathml"  # which browsers show without a network
html_theme = "furo"
html_title = f"Slipstand {__version__}"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0B5FA5", "color-brand-content": "#0B5FA5"},
    "dark_css_variables": {"color-brand-primary": "#6DB3F2", "color-brand-content": "#6DB3F2"},
}
html_copy_source = False
html_show_sourcelink = False

OUTSIDE = {
    "README.md": "about",
    "CONTRIBUTING.md": "contributing",
    "CHANGELOG.md": "changelog",
    "firmware/README.md": "firmware",
    "recordings/README.md": "run-files",
}
"""Pages that stand elsewhere in the repository, with their names in the folder `_outside` of the site."""
_LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s:]+)(#[^)\s]*)?\)")


def copy_outside_pages(_app: Any) -> None:
    """Make a page of the site of each page outside of this folder."""
    (DOCS / "_outside").mkdir(exist_ok=True)
    for source, name in OUTSIDE.items():
        (DOCS / "_outside" / f"{name}.md").write_text((ROOT / source).read_text("utf-8"), "utf-8")


def resolve_links(_app: Any, page: str, text: list[str]) -> None:
    """Let links lead to the pages of the site; files that are no pages are named without a link."""
    sources = {f"_outside/{name}": ROOT / source for source, name in OUTSIDE.items()}
    place = sources.get(page, DOCS / f"{page}.md")

    def resolve(link: re.Match[str]) -> str:
        target, anchor = Path(os.path.normpath(place.parent / link[2])), link[3] or ""
        name = OUTSIDE.get(os.path.relpath(target, ROOT).replace(os.sep, "/"))
        if target == DOCS / "README.md":
            return f"[{link[1]}](/index.md)"
        if name is not None:
            return f"[{link[1]}](/_outside/{name}.md{anchor})"
        if target.is_relative_to(DOCS) and not target.is_dir():
            return f"[{link[1]}](/{target.relative_to(DOCS).as_posix()}{anchor})"
        return f"`{link[1].strip('`')}`" if target.exists() else link[0]

    text[0] = _LINK.sub(resolve, text[0])


def write_math(translator: Any, node: Any) -> None:
    """Write a formula as MathML."""
    display = "inline" if isinstance(node, nodes.math) else "block"
    translator.body.append(convert(node.astext(), display=display))
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Connect to Sphinx."""
    app.add_html_math_renderer("mathml", (write_math, None), (write_math, None))
    app.connect("builder-inited", copy_outside_pages)
    app.connect("source-read", resolve_links)
    app.connect("include-read", lambda app, _relative, page, text: resolve_links(app, page, text))
