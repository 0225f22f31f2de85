"""The figure of a calibration: the curve through its readings, and what is left between them."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from analysis.calibration.calibrate import Calibration
from app.reports.look import MUTED, PLATE, SIMULATION, TABLE

_WAYS = ((1, "up", TABLE, "^"), (-1, "down", PLATE, "v"))


def save_calibration_figure(path: Path, found: Calibration, title: str) -> None:
    """Draw readings, curve and residuals to a PNG, SVG or PDF file. Raises OSError."""
    figure = Figure(figsize=(7.2, 5.6), layout="constrained")
    curve, residual = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    readings = found.readings
    counts = np.linspace(readings.counts.min(), readings.counts.max(), 201)
    curve.plot(
        found.displacement_m(counts) * 1e3, counts, color=SIMULATION, linewidth=0.9, label="calibration"
    )
    for way, label, colour, mark in _WAYS:
        shown = readings.direction == way
        dial_mm = readings.dial_m[shown] * 1e3
        style = {"linestyle": "", "marker": mark, "color": colour, "markersize": 5, "label": label}
        curve.plot(dial_mm, readings.counts[shown], **style)
        residual.plot(dial_mm, found.residual_m[shown] * 1e6, **style)
    residual.axhline(0.0, color=MUTED, linewidth=0.8)
    for axes, label in ((curve, "counts"), (residual, "dial − calibration (µm)")):
        axes.set_ylabel(label, fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.2)
        axes.spines[["top", "right"]].set_visible(False)
    curve.legend(frameon=False, fontsize=8)
    residual.set_xlabel("dial gauge (mm)")
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    figure.savefig(path, dpi=150)
