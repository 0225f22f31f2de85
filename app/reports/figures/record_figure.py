"""Figure of one test: record, simulation and residuals of both channels."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.catalogue import Place, Unit, definition, reading_units
from analysis.identification import Degree, Identification
from analysis.record import Record
from app.reports.figures.style import (
    PLATE,
    SIMULATION,
    TABLE,
    StyledFigure,
    decimate_for_print,
    print_style,
    save_figure,
)

_BEFORE_RELEASE_S = 1.0
_AFTER_FIT_S = 1.0  # shown beyond what was fitted
_DISTURBED = "#B3261E"
_ONE_MASS = ("period_s", "damping_n_per_s", "coulomb_displacement_m")  # in the title of a free decay

FloatArray = NDArray[np.float64]


def save_record_figure(
    path: Path, record: Record, identification: Identification, title: str, unit: str = "m"
) -> None:
    """Draw readings in `unit` and simulation of both channels, and the residuals, to a PNG, SVG or PDF file.

    Raises OSError when the file cannot be written.
    """
    with print_style():
        figure = record_figure(record, identification, unit)
        figure.suptitle(figure_title(title, identification), fontsize=10, x=0.01, ha="left")
        save_figure(figure, path)


def record_figure(record: Record, identification: Identification, unit: str = "m") -> Figure:
    """Draw readings in `unit` and simulation of both channels, and the residuals of each in a panel.

    Call it within `print_style`. It shows the whole span that was fitted, from a second before the release.
    Slip is shaded. Grey and hatched: what was not fitted, after the free decay ended. Red: absent and
    overloaded readings.
    """
    shown_unit, residual_unit = reading_units(unit)
    time_s = record.time_s - (identification.events.release_s or 0.0)
    shown = _shown(time_s, identification)
    curves = identification.curves(record.time_s[shown]) if identification.curves else None
    label = "plate $u_2$" if record.gauge_2_measures_plate else "relative $u_2 - u_1$"
    fits = (curves.table_displacement_m, curves.relative_displacement_m) if curves else (None, None)
    channels = [
        (TABLE, "table $u_1$", record.table_displacement_m, fits[0], record.table_overload),
        (PLATE, label, record.relative_displacement_m, fits[1], record.relative_overload),
    ]
    panels = [
        (colour, label, read[shown], fit, None if overload is None else overload[shown])
        for colour, label, read, fit, overload in channels
        if read is not None
    ]
    heights = [2.0, 1.2] if curves is not None else [2.0]
    figure = StyledFigure(figsize=(7.2, 0.4 + sum(heights) * len(panels)), layout="constrained")
    count = len(heights) * len(panels)
    ratios = heights * len(panels)
    every: list[Axes] = list(
        figure.subplots(count, 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0]
    )
    for place, (colour, label, reading_m, fit_m, overload) in enumerate(panels):
        axes = every[place * len(heights)]
        _channel(axes, colour, time_s[shown], shown_unit.scale * reading_m, fit_m, shown_unit.scale)
        axes.set_ylabel(shown_unit.labelled(label))
        _mark_unread(axes, time_s[shown], reading_m, overload)
        if fit_m is not None:
            beside = every[place * len(heights) + 1]
            residual = decimate_for_print(time_s[shown], residual_unit.scale * (reading_m - fit_m))
            beside.plot(*residual, color=colour, linewidth=0.5, label="record − simulation")
            _label_residuals(beside, identification, residual_unit)
    _shade(every, identification, float(time_s[shown][-1]) if shown.any() else 0.0)
    every[-1].set_xlabel("time since release (s)" if identification.events.release_s else "time (s)")
    return figure


def record_caption(record: Record, identification: Identification) -> str:
    """Caption of the figure, which explains the marks that it has."""
    events = identification.events
    parts = ["Record, simulation with the fitted parameters, and residuals, over all that was fitted."]
    if events.release_s is not None and events.slip_end_s is not None:
        parts.append("Shaded: slip.")
    if events.free_decay_end_s is not None:
        parts.append("Hatched: not fitted, after the free decay.")
    shown = _shown(record.time_s - (events.release_s or 0.0), identification)
    gauges = (
        (record.table_displacement_m, record.table_overload),
        (record.relative_displacement_m, record.relative_overload),
    )
    if any(read is not None and _unread(read, overload)[shown].any() for read, overload in gauges):
        parts.append("Red marks: absent or overloaded readings.")
    return " ".join(parts)


def _shown(time_s: FloatArray, identification: Identification) -> NDArray[np.bool_]:
    release_s, slip_end_s = identification.events.release_s, identification.events.slip_end_s
    if identification.kind == "one-mass" and "turning_s" in identification.parameters:
        return time_s >= identification.parameters["turning_s"]  # before it nothing was fitted
    if release_s is None or slip_end_s is None:
        return np.ones(len(time_s), dtype=np.bool_)
    end_s = identification.events.free_decay_end_s
    last_s = np.inf if end_s is None else end_s - release_s + _AFTER_FIT_S
    return (time_s >= -_BEFORE_RELEASE_S) & (time_s <= last_s)


def _shade(every: list[Axes], identification: Identification, last_s: float) -> None:
    """Shade the slip, and hatch what was not fitted, up to the last time shown."""
    events = identification.events
    start_s = events.release_s or 0.0
    for axes in every:
        if events.release_s is not None and events.slip_end_s is not None:
            axes.axvspan(0.0, events.slip_end_s - start_s, color=PLATE, alpha=0.07, linewidth=0)
        if events.free_decay_end_s is not None:
            axes.axvspan(
                events.free_decay_end_s - start_s, last_s, facecolor="0.92", edgecolor="0.7", hatch="////",
                linewidth=0, zorder=0.5,
            )  # fmt: skip


def _mark_unread(
    axes: Axes, time_s: FloatArray, reading: FloatArray, overload: NDArray[np.bool_] | None
) -> None:
    """Mark times at which a reading is absent or overloaded, along the lower edge."""
    unread = _unread(reading, overload)
    if unread.any():
        # the width of a mark is that of a line: a single reading of thousands would be too narrow to be seen
        axes.plot(
            time_s[unread], np.zeros(int(unread.sum())), transform=axes.get_xaxis_transform(),
            color=_DISTURBED, marker="|", markersize=8, linestyle="none", clip_on=False,
            label="absent or overloaded",
        )  # fmt: skip
        axes.legend(loc="upper right", ncols=3)


def _unread(reading: FloatArray, overload: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    return np.isnan(reading) if overload is None else np.isnan(reading) | overload


def _channel(
    axes: Axes, colour: str, time_s: FloatArray, reading: FloatArray, fit: FloatArray | None, scale: float
) -> None:
    record = decimate_for_print(time_s, reading)
    axes.plot(*record, color=colour, linewidth=2.0, alpha=0.6, label="record")
    if fit is not None:
        simulation = decimate_for_print(time_s, scale * fit)
        axes.plot(*simulation, color=SIMULATION, linewidth=0.9, linestyle=(0, (4, 3)), label="simulation")
    axes.legend(loc="upper right", ncols=2)


def _label_residuals(axes: Axes, identification: Identification, unit: Unit) -> None:
    axes.set_ylabel(unit.labelled("residual"))
    if identification.model:
        noise = unit.scale * identification.model.noise_rms_m
        for level, text in ((2 * noise, "± 2 × noise"), (-2 * noise, None)):
            axes.axhline(level, color=SIMULATION, linewidth=0.8, linestyle=":", label=text)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.25 * (high - low))  # room for the legend
    axes.legend(loc="upper right", ncols=2)


def figure_title(title: str, identification: Identification) -> str:
    """Title with f_d, or T, n and x_k of one mass, and the verdict on the fitted law."""
    found, model = identification.results.get("friction_dynamic"), identification.model
    verdict = "model fits" if model and model.adequate else "model does not fit"
    if model and model.degree is Degree.FRICTION:
        what = "$T$ and $n$ hold" if identification.kind == "one-mass" else "$f_d$ holds"
        verdict = f"model does not fit, {what}"
    if identification.kind == "one-mass":
        shown = [(definition(name), identification.results[name]) for name in _ONE_MASS]
        values = [f"{row.symbol.latex} = {row.format(one, Place.REPORT).in_print}" for row, one in shown]
        return f"{title}\n{'    '.join([*values, verdict])}"
    if found is None:
        return title
    friction = definition("friction_dynamic").format(found, Place.REPORT).in_print
    return f"{title}    $f_d$ = {friction}    {verdict}"
