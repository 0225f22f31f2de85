"""Fig. 2 of the paper: static and dynamic friction by contact, with the values of each series."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from analysis.campaign.contacts import ContactFriction
from analysis.quantities import Quantity
from app.reports.figures.style import PLATE, SIMULATION, TABLE, new_figure, place_legend_above
from config.schema import Stand

CAPTION: Final = (
    "Static and dynamic friction by contact. Bars: mean over the series, with its 95 % interval; points:"
    " series, with theirs (f_s from its bounds where no law determined it); triangles: series that bound f_s"
    " from below only."
)
_WIDTH = 0.36
_SPREAD = 0.22
_STATIC_SHADE, _DYNAMIC_SHADE = 0.55, 0.2
_NAME_LENGTH = 14


def contact_names(stands: Iterable[Stand]) -> dict[str, str]:
    """Names of contacts on these stands, by code."""
    return {code: contact.name for stand in stands for code, contact in stand.contacts.items()}


def friction_figure(contacts: Sequence[ContactFriction], names: Mapping[str, str]) -> Figure | None:
    """Draw Fig. 2 within `print_style`; None without any. `names` are those of the contacts."""
    shown = [one for one in contacts if one.dynamic or one.static or one.static_at_least]
    if not shown:
        return None
    figure, axes = new_figure(height_in=2.8)
    for place, contact in enumerate(shown):
        left, right, least = place - _WIDTH / 2, place + _WIDTH / 2, list(contact.static_at_least.values())
        _bar(axes, left, contact.static, contact.static_of_series, TABLE, _STATIC_SHADE)
        axes.plot(_beside(left, len(least)), least, color=TABLE, linestyle="", marker="^", markersize=4.0)
        _bar(axes, right, contact.dynamic, contact.dynamic_of_series, PLATE, _DYNAMIC_SHADE)
    axes.set_xticks(range(len(shown)), [_label(one.contact, names) for one in shown])
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.6, len(shown) - 0.4)
    axes.set_ylim(bottom=0.0)
    axes.grid(visible=False, axis="x")
    axes.set_ylabel("friction coefficient")
    handles: list[Patch | Line2D] = [
        Patch(**_look(TABLE, _STATIC_SHADE), label="static $f_s$"),
        Patch(**_look(PLATE, _DYNAMIC_SHADE), label="dynamic $f_d$"),
    ]
    if any(one.static_at_least for one in shown):
        handles.append(Line2D([], [], color=TABLE, linestyle="", marker="^", label="$f_s$ at least"))
    place_legend_above(axes, handles=handles, ncols=3)
    return figure


def _bar(
    axes: Axes, place: float, mean: Quantity | None, series: Mapping[str, Quantity], colour: str, shade: float
) -> None:
    if mean is None:
        return
    axes.bar(place, mean.value, _WIDTH * 0.92, **_look(colour, shade))
    for at, one in zip(_beside(place, len(series)), series.values(), strict=True):
        _with_interval(axes, at, one, "o", 2.0, 0.6)
    _with_interval(axes, place, mean, "", 0.0, 1.4)


def _with_interval(axes: Axes, place: float, found: Quantity, mark: str, size: float, width: float) -> None:
    low, high = found.interval_95
    reach = np.nan_to_num(np.maximum([[found.value - low], [high - found.value]], 0.0))
    axes.errorbar(
        place, found.value, yerr=reach, fmt=mark or "none", color=SIMULATION, ecolor=SIMULATION,
        markersize=size, elinewidth=width, capsize=3.0 if not mark else 1.5, capthick=width,
    )  # fmt: skip


def _beside(place: float, count: int) -> list[float]:
    """Places of points that would hide one another."""
    even = count + count % 2  # none in the middle, where the mean's interval is
    return list(place + np.linspace(-_SPREAD / 2, _SPREAD / 2, even)[:count])


def _look(colour: str, shade: float) -> dict[str, Any]:
    """Return an opaque tint, darker for f_s, so that both differ in grey print; patterns print unevenly."""
    ink = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)])
    face = tuple(np.round(255.0 - shade * (255.0 - ink)) / 255.0)
    return {"facecolor": face, "edgecolor": colour, "linewidth": 0.8}


def _label(contact: str, names: Mapping[str, str]) -> str:
    if not contact:
        return "contact\nunknown"
    lines = [contact]
    for word in names.get(contact, "").split():
        if len(lines) > 1 and len(lines[-1]) + len(word) < _NAME_LENGTH:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return "\n".join(lines)
