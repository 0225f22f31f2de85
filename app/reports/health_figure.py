"""The figure of the gauges' health: the spectrum of both at rest."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from analysis.gauge_health import GaugeHealth
from analysis.readings.mains import MAINS_HZ
from app.reports.look import MUTED, PLATE, TABLE


def save_health_figure(path: Path, gauges: Sequence[GaugeHealth], names: Sequence[str], title: str) -> None:
    """Draw the amplitude density of each gauge to a PNG, SVG or PDF file. Raises OSError."""
    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    axes = figure.subplots()
    for health, name, colour in zip(gauges, names, (TABLE, PLATE), strict=False):
        spectrum = health.spectrum
        label = f"{name}, {health.noise_rms_m * 1e6:.3g} µm rms"
        axes.loglog(
            spectrum.frequency_hz[1:], spectrum.density_m[1:] * 1e6, color=colour, linewidth=1.0, label=label
        )
    for frequency_hz in MAINS_HZ:
        axes.axvline(frequency_hz, color=MUTED, linewidth=0.8, linestyle=(0, (2, 3)))
    axes.set_xlabel("frequency (Hz); 50 and 60 Hz of the mains dotted", fontsize=9)
    axes.set_ylabel(r"noise (µm/$\sqrt{\mathrm{Hz}}$)", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.2)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8)
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    figure.savefig(path, dpi=150)
