"""The figure of the gauges' health: the spectrum of both at rest."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.gauge_health import GaugeHealth
from analysis.readings.mains import MAINS_HZ
from app.reports.figure_style import DASHED, MUTED, PLATE, TABLE, print_style, save_figure


def save_health_figure(path: Path, gauges: Sequence[GaugeHealth], names: Sequence[str], title: str) -> None:
    """Draw the amplitude density of each gauge to a PNG, SVG or PDF file. Raises OSError."""
    with print_style():
        figure = Figure(figsize=(7.2, 4.2), layout="constrained")
        _draw(figure.subplots(), gauges, names)
        figure.suptitle(title, fontsize=10, x=0.01, ha="left")
        save_figure(figure, path)


def _draw(axes: Axes, gauges: Sequence[GaugeHealth], names: Sequence[str]) -> None:
    for health, name, colour, dash in zip(gauges, names, (TABLE, PLATE), ("-", DASHED), strict=False):
        spectrum = health.spectrum
        label = f"{name}, {health.noise_rms_m * 1e6:.3g} µm rms"
        density_um = spectrum.density_m_per_sqrt_hz[1:] * 1e6
        axes.loglog(spectrum.frequency_hz[1:], density_um, color=colour, linestyle=dash, label=label)
    for frequency_hz in MAINS_HZ:
        axes.axvline(frequency_hz, color=MUTED, linewidth=0.8, linestyle=(0, (2, 3)))
    axes.set_xlabel("frequency (Hz); 50 and 60 Hz of the mains dotted")
    axes.set_ylabel("noise (µm/√Hz)")
    axes.legend()
