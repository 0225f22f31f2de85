"""`slipstand device health`: how the gauges do while the stand rests."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.options import (
    Baud,
    DeviceRate,
    DeviceSettings,
    Json,
    Parity,
    RelativePort,
    port_settings,
    positive,
)

if TYPE_CHECKING:
    from analysis.gauge_health import GaugeHealth
    from app.acquisition.messages import PortSettings
    from app.presenters.gauge_health import GaugeHealthState


def health(
    port: Annotated[str, typer.Option(help="Serial port or URL of the device.")],
    protocol: Annotated[str, typer.Option(help="Protocol name, see `slipstand device list`.")],
    seconds: Annotated[float, typer.Option(help="Seconds of looking; the stand rests meanwhile.")] = 5.0,
    rate: DeviceRate = None,
    baud: Baud = None,
    parity: Parity = "N",
    relative_port: RelativePort = "",
    settings: DeviceSettings = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file; gauges.toml if absent.")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw the spectra: PNG, SVG or PDF.")] = None,
    as_json: Json = False,
) -> None:
    """Look at both gauges at rest: noise, drift, hum, range.

    Each is good, doubtful or bad, with what to do. Ends with 1 if one is bad.
    """
    from analysis.gauge_health import HealthGrade, measure_health
    from app.cli.recording import calibration_file
    from app.presenters.gauge_health import GAUGE_NAMES, gauge_health_state

    positive("--seconds", seconds)
    _check_figure(figure)
    device = port_settings(port, protocol, relative_port, rate, baud, parity, settings)
    title, pair = _watch_gauges(device, calibration_file(calibration), seconds)
    measured = [measure_health(gauge) for gauge in pair]
    states = [gauge_health_state(name, one) for name, one in zip(GAUGE_NAMES, measured, strict=True)]
    if figure is not None:
        from app.reports.figures.gauge_figures import save_health_figure

        save_health_figure(figure.expanduser(), measured, GAUGE_NAMES, title)
    if as_json:
        out.print_json(health_document(title, seconds, measured, states))
    else:
        _print_health(title, seconds, states)
    if any(state.verdict is HealthGrade.BAD for state in states):
        raise typer.Exit(1)


def _check_figure(figure: Path | None) -> None:
    if figure is None:
        return
    if figure.suffix not in (".png", ".svg", ".pdf"):
        raise CommandError(f"--figure {figure.name} has no known ending. Use .png, .svg or .pdf")
    if not figure.expanduser().absolute().parent.is_dir():
        raise CommandError(
            f"--figure {figure}: there is no such folder. Make it first or choose another path"
        )


def _watch_gauges(port: "PortSettings", gauges_file: Path, seconds: float) -> tuple[str, Any]:
    from app.acquisition.gauge_samples import collect_samples
    from app.acquisition.run_setup import complete_port_settings
    from app.acquisition.stream.live_stream import open_stream
    from config.files import load_gauges

    gauges = load_gauges(gauges_file)
    with open_stream(complete_port_settings(port, gauges.device), gauges) as stream:
        title = f"{stream.identity.name or port.protocol}, {stream.rate_hz:g} Hz"
        out.print_status(f"{title}. Leave the stand alone for {seconds:g} s")
        return title, collect_samples(stream, seconds, gauges)


def _print_health(title: str, seconds: float, states: "list[GaugeHealthState]") -> None:
    out.print_line(f"{title}, {seconds:g} s at rest")
    rows = [
        (one.label, *(state.figures[line].value for state in states))
        for line, one in enumerate(states[0].figures)
    ]
    out.print_table(("", *(state.name for state in states)), rows)
    for state in states:
        out.print_line(f"{state.name}: {state.verdict}")
        for symptom in state.symptoms:
            out.print_line(f"  {symptom.grade}  {symptom.message}")
            out.print_line(f"        {symptom.remedy}")


def health_document(
    title: str, seconds: float, measured: "list[GaugeHealth]", states: "list[GaugeHealthState]"
) -> dict[str, Any]:
    """JSON object of both gauges' health."""
    return {
        "schema": "slipstand-gauge-health/1",
        "device": title,
        "seconds": seconds,
        "gauges": [
            {"gauge": name, "verdict": str(state.verdict), **_numbers(health), "symptoms": _symptoms(state)}
            for name, health, state in zip(("table", "relative"), measured, states, strict=True)
        ],
    }


def _numbers(health: "GaugeHealth") -> dict[str, Any]:
    return {
        "samples": health.samples,
        "mean_m": health.mean_m,
        "noise_rms_m": health.noise_rms_m,
        "drift_m_per_min": health.drift_m_per_min,
        "swing_m": health.oscillation_amplitude_m,
        "step_m": health.resolution_m,
        "range_used": health.range_fraction,
        "absent_share": health.missing_fraction,
        "overloaded_share": health.overload_fraction,
        "clipped_share": health.clipped_fraction,
        "repeated_share": health.repeated_fraction,
        "drift_standard_uncertainty_m_per_min": health.drift_standard_uncertainty_m_per_min,
        "hum": [{"frequency_hz": hum.frequency_hz, "amplitude_m": hum.amplitude_m} for hum in health.hum],
    }


def _symptoms(state: "GaugeHealthState") -> list[dict[str, str]]:
    return [
        {"code": one.code, "verdict": str(one.grade), "message": one.message, "remedy": one.remedy}
        for one in state.symptoms
    ]
