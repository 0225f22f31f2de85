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
    decimate_for_print,
    print_style,
    save_figure,
)

_BEFORE_RELEASE_S = 0.5
_AFTER_SLIP_S = 2.0
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
    """Draw readings in `unit` and simulation of both channels, and the residuals where there is a simulation.

    Call it within `print_style`. It shows the time from shortly before the release to two seconds after the
    last slip, or the whole record without slip.
    """
    shown_unit, residual_unit = reading_units(unit)
    time_s = record.time_s - (identification.events.release_s or 0.0)
    shown = _shown(time_s, identification)
    curves = identification.curves(record.time_s[shown]) if identification.curves else None
    label = "plate $u_2$" if record.gauge_2_measures_plate else "relative $u_2 - u_1$"
    fits = (curves.table_displacement_m, curves.relative_displacement_m) if curves else (None, None)
    channels = [
        (TABLE, "table", "table $u_1$", record.table_displacement_m, fits[0]),
        (PLATE, "relative", label, record.relative_displacement_m, fits[1]),
    ]
    panels = [
        (colour, name, label, read[shown], fit)
        for colour, name, label, read, fit in channels
        if read is not None
    ]
    count = len(panels) + (curves is not None)
    figure = Figure(figsize=(7.2, 0.4 + 2.0 * count), layout="constrained")
    every: list[Axes] = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    for axes, (colour, name, label, reading_m, fit_m) in zip(every, panels, strict=False):
        _channel(axes, colour, time_s[shown], shown_unit.scale * reading_m, fit_m, shown_unit.scale)
        axes.set_ylabel(shown_unit.labelled(label))
        if fit_m is not None:
            residual = decimate_for_print(time_s[shown], residual_unit.scale * (reading_m - fit_m))
            every[-1].plot(*residual, color=colour, linewidth=0.5, label=name)
    if curves is not None:
        _label_residuals(every[-1], identification, residual_unit)
    release_s, slip_end_s = identification.events.release_s, identification.events.slip_end_s
    if release_s is not None and slip_end_s is not None:
        for axes in every:
            axes.axvspan(0.0, slip_end_s - release_s, color=PLATE, alpha=0.07, linewidth=0)
    every[-1].set_xlabel("time since release (s)" if release_s else "time (s)")
    return figure


def _shown(time_s: FloatArray, identification: Identification) -> NDArray[np.bool_]:
    release_s, slip_end_s = identification.events.release_s, identification.events.slip_end_s
    if identification.kind == "one-mass" and "turning_s" in identification.parameters:
        return time_s >= identification.parameters["turning_s"]  # before it nothing was fitted
    if release_s is None or slip_end_s is None:
        return np.ones(len(time_s), dtype=np.bool_)
    return (time_s >= -_BEFORE_RELEASE_S) & (time_s <= slip_end_s - release_s + _AFTER_SLIP_S)


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
    axes.set_ylabel(unit.labelled("record − simulation"))
    if identification.model:
        noise = unit.scale * identification.model.noise_rms_m
        for level, text in ((2 * noise, "± 2 × noise"), (-2 * noise, None)):
            axes.axhline(level, color=SIMULATION, linewidth=0.8, linestyle=":", label=text)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.25 * (high - low))  # room for the legend
    axes.legend(loc="upper right", ncols=3)


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
    return f"{title}    $f_d$ = {found.value:.5f} ± {found.standard_uncertainty:.5f}    {verdict}"
