"""The figure of one test: record against simulation for both channels, and what is left between them."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.identification import Curves, Identification
from analysis.record import Record
from app.reports.look import MUTED, PLATE, SIMULATION, TABLE

_BEFORE_RELEASE_S = 0.5
_AFTER_SLIP_S = 2.0

FloatArray = NDArray[np.float64]


def save_record_figure(path: Path, record: Record, identification: Identification, title: str) -> None:
    """Draw record and simulation of both channels, and the residuals, to a PNG, SVG or PDF file.

    Shown is the time from shortly before release to two seconds after the last slip; the whole record
    where there was no slip. Raises OSError when the file cannot be written.
    """
    figure = Figure(figsize=(7.2, 6.4), layout="constrained")
    table, relative, residual = figure.subplots(3, 1, sharex=True)
    time_s = record.time_s - (identification.events.release_s or 0.0)
    shown = _shown(time_s, identification)
    curves = identification.curves(record.time_s[shown]) if identification.curves else None
    _channel(table, "table $u_1$ (mm)", TABLE, time_s[shown], record.table_displacement_m[shown],
             curves.table_displacement_m if curves else None)  # fmt: skip
    if record.relative_displacement_m is not None:
        label = "plate $u_2$ (mm)" if record.gauge_2_measures_plate else r"relative $u_2 - u_1$ (mm)"
        _channel(relative, label, PLATE, time_s[shown], record.relative_displacement_m[shown],
                 curves.relative_displacement_m if curves else None)  # fmt: skip
    _residual(residual, time_s[shown], record, shown, curves, identification)
    for axes in (table, relative, residual):
        _shade_slip(axes, identification)
    residual.set_xlabel("time since release (s)")
    figure.suptitle(_title(title, identification), fontsize=10, x=0.01, ha="left")
    figure.savefig(path, dpi=150)


def _shown(time_s: FloatArray, identification: Identification) -> NDArray[np.bool_]:
    release_s, slip_end_s = identification.events.release_s, identification.events.slip_end_s
    if release_s is None or slip_end_s is None:
        return np.ones(len(time_s), dtype=np.bool_)
    return (time_s >= -_BEFORE_RELEASE_S) & (time_s <= slip_end_s - release_s + _AFTER_SLIP_S)


def _channel(
    axes: Axes, label: str, colour: str, time_s: FloatArray, reading_m: FloatArray, fit_m: FloatArray | None
) -> None:
    axes.plot(time_s, reading_m * 1e3, color=colour, linewidth=2.0, alpha=0.6, label="record")
    if fit_m is not None:
        axes.plot(
            time_s, fit_m * 1e3, color=SIMULATION, linewidth=0.9, linestyle=(0, (4, 3)), label="simulation"
        )
    axes.legend(loc="upper right", frameon=False, fontsize=8, ncols=2)
    _dress(axes, label)


def _residual(
    axes: Axes,
    time_s: FloatArray,
    record: Record,
    shown: NDArray[np.bool_],
    curves: Curves | None,
    identification: Identification,
) -> None:
    _dress(axes, "record − simulation (µm)")
    if curves is None:
        axes.text(0.5, 0.5, "no law of motion was fitted", transform=axes.transAxes, ha="center", color=MUTED)
        return
    residual_m = record.table_displacement_m[shown] - curves.table_displacement_m
    axes.plot(time_s, residual_m * 1e6, color=TABLE, linewidth=0.5, label="table")
    if record.relative_displacement_m is not None and curves.relative_displacement_m is not None:
        residual_m = record.relative_displacement_m[shown] - curves.relative_displacement_m
        axes.plot(time_s, residual_m * 1e6, color=PLATE, linewidth=0.5, label="relative")
    if identification.model:
        noise_um = identification.model.noise_rms_m * 1e6
        for level, label in ((2 * noise_um, "± 2 × noise"), (-2 * noise_um, None)):
            axes.axhline(level, color=SIMULATION, linewidth=0.8, linestyle=":", label=label)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.25 * (high - low))  # room for the legend
    axes.legend(loc="upper right", frameon=False, fontsize=8, ncols=3)


def _shade_slip(axes: Axes, identification: Identification) -> None:
    release_s, slip_end_s = identification.events.release_s, identification.events.slip_end_s
    if release_s is not None and slip_end_s is not None:
        axes.axvspan(0.0, slip_end_s - release_s, color=PLATE, alpha=0.07, linewidth=0)


def _dress(axes: Axes, label: str) -> None:
    axes.set_ylabel(label, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.2)
    axes.spines[["top", "right"]].set_visible(False)


def _title(title: str, identification: Identification) -> str:
    found = identification.results.get("friction_dynamic")
    if found is None:
        return title
    verdict = "model fits" if identification.model and identification.model.adequate else "model does not fit"
    return f"{title}    $f_d$ = {found.value:.5f} ± {found.standard_uncertainty:.5f}    {verdict}"
