"""Figures of gauges: calibration curve with residuals, and noise spectra at rest."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from analysis.calibration.calibrate import Calibration
from analysis.catalogue import MICROMETRE, MILLIMETRE
from analysis.gauge_health import GaugeHealth
from analysis.preparation.channels import MAINS_HZ
from app.reports.figures.style import DASHED, MUTED, PLATE, SIMULATION, TABLE, titled_figure

_BRANCHES = ((1, "up", TABLE, "^"), (-1, "down", PLATE, "v"))


def save_calibration_figure(path: Path, found: Calibration, title: str) -> None:
    """Draw readings, curve and residuals to a PNG, SVG or PDF file. Raises OSError."""
    with titled_figure(path, title, height_in=5.6) as figure:
        curve, residual = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        _draw_calibration(curve, residual, found)


def _draw_calibration(curve: Axes, residual: Axes, found: Calibration) -> None:
    readings = found.points
    counts = np.linspace(readings.counts.min(), readings.counts.max(), 201)
    curve_mm = MILLIMETRE.scale * found.displacement_m(counts)
    curve.plot(curve_mm, counts, color=SIMULATION, linewidth=0.9, label="calibration")
    for way, label, colour, mark in _BRANCHES:
        shown = readings.direction == way
        dial_mm = readings.dial_m[shown] * MILLIMETRE.scale
        style: dict[str, Any] = {"linestyle": "", "marker": mark, "color": colour, "label": label}
        curve.plot(dial_mm, readings.counts[shown], **style)
        residual.plot(dial_mm, found.residual_m[shown] * MICROMETRE.scale, **style)
    residual.axhline(0.0, color=MUTED, linewidth=0.8)
    curve.set_ylabel("counts")
    curve.legend()
    residual.set_ylabel(MICROMETRE.labelled("dial − calibration"))
    residual.set_xlabel(MILLIMETRE.labelled("dial gauge"))


def save_health_figure(path: Path, gauges: Sequence[GaugeHealth], names: Sequence[str], title: str) -> None:
    """Draw the amplitude density of each gauge to a PNG, SVG or PDF file. Raises OSError."""
    with titled_figure(path, title, height_in=4.2) as figure:
        _draw_spectra(figure.subplots(), gauges, names)


def _draw_spectra(axes: Axes, gauges: Sequence[GaugeHealth], names: Sequence[str]) -> None:
    for health, name, colour, dash in zip(gauges, names, (TABLE, PLATE), ("-", DASHED), strict=False):
        spectrum = health.spectrum
        label = f"{name}, {MICROMETRE.scale * health.noise_rms_m:.3g} {MICROMETRE.symbol} rms"
        density_um = spectrum.density_m_per_sqrt_hz[1:] * MICROMETRE.scale
        axes.loglog(spectrum.frequency_hz[1:], density_um, color=colour, linestyle=dash, label=label)
    for frequency_hz in MAINS_HZ:
        axes.axvline(frequency_hz, color=MUTED, linewidth=0.8, linestyle=(0, (2, 3)))
    axes.set_xlabel("frequency (Hz); 50 and 60 Hz of the mains dotted")
    axes.set_ylabel(f"noise ({MICROMETRE.symbol}/√Hz)")
    axes.legend()
