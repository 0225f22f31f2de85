"""Style of printed figures: colours, typeface, and files that are reproducible to the byte."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import as_file, files
from io import StringIO
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from fontpkg_ibm_plex_sans import ROOT
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

TABLE, PLATE, SIMULATION, MUTED = "#0B5FA5", "#B8500A", "#1B2330", "#5A6675"
"""Colours of the channels and of the simulation, as in the window."""
DASHED: Final = (0, (4, 2))
FORMATS: Final = ("png", "svg", "pdf")
FAMILY = "IBM Plex Sans"
COLUMN_IN = 3.46  # width of a column of a journal, 88 mm
HEIGHT_IN = 2.5
_STRETCHES = 4000  # more stretches than a page has dots across at 300 dpi
Floats = NDArray[np.float64]
_REPRODUCIBLE: Final[dict[str, dict[str, Any]]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""Metadata left out, because they hold a date or a version."""


@contextmanager
def print_style() -> Iterator[None]:
    """Context with the style of printed figures (`print.mplstyle`)."""
    if not any(entry.name == FAMILY for entry in font_manager.fontManager.ttflist):
        for file in typeface_files():
            font_manager.fontManager.addfont(file)
    with (
        as_file(files("app.reports.figures") / "print.mplstyle") as style,
        mpl.rc_context(mpl.rc_params_from_file(style, use_default_template=False)),
    ):
        yield


class StyledFigure(Figure):
    """Figure that is drawn in the style of printed figures by whoever draws it, as a notebook does.

    Symbols get their typeface when they are drawn.
    """

    def draw(self, renderer: Any) -> None:
        with print_style():
            super().draw(renderer)


def new_figure(height_in: float = HEIGHT_IN) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(COLUMN_IN, height_in), layout="constrained")
    return figure, figure.subplots()


def place_legend_above(axes: Axes, **options: Any) -> None:
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1, **options)


def decimate_for_print(time_s: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Decimate a curve of very many readings (n,) to the minimum and maximum of each stretch."""
    if len(value) <= 2 * _STRETCHES:
        return time_s, value
    edges = np.arange(_STRETCHES + 1) * len(value) // _STRETCHES
    ends = np.fmin.reduceat(value, edges[:-1]), np.fmax.reduceat(value, edges[:-1])
    return np.repeat(time_s[(edges[:-1] + edges[1:]) // 2], 2), np.column_stack(ends).ravel()


def save_figure(figure: Figure, path: Path) -> None:
    """Write a PNG, SVG or PDF file by its ending, the same bytes each time. Raises OSError."""
    figure.savefig(path, metadata=_REPRODUCIBLE[path.suffix[1:].lower()])


@contextmanager
def titled_figure(path: Path, title: str, height_in: float) -> Iterator[Figure]:
    """Figure over the full width of a page, written to a file with its title. Raises OSError."""
    with print_style():
        figure = Figure(figsize=(7.2, height_in), layout="constrained")
        yield figure
        figure.suptitle(title, fontsize=10, x=0.01, ha="left")
        save_figure(figure, path)


def figure_svg(figure: Figure) -> str:
    buffer = StringIO()
    figure.savefig(buffer, format="svg", metadata=_REPRODUCIBLE["svg"])
    return buffer.getvalue()


def typeface_files() -> list[Path]:
    return sorted(Path(ROOT).rglob("*.ttf"))
