"""`slipstand device health`: how the gauges do while the stand rests."""

from typing import Any

import typer

from analysis.gauge_health import GaugeHealth, measure_health
from analysis.health_grade import HealthGrade
from app.acquisition.gauge_samples import collect_samples
from app.cli import output as out
from app.cli.calibrate import open_gauges
from app.cli.device_options import HealthOptions
from app.cli.option_values import calibration_file, device_settings, figure_file
from app.presenters.gauge_health import GAUGE_NAMES, gauge_health_state
from app.presenters.gauge_health_state import GaugeHealthState
from config.files import load_gauges


def health(options: HealthOptions) -> None:
    figure, port = figure_file(options.figure), device_settings(options.source)
    gauges = load_gauges(calibration_file(options.calibration))
    with open_gauges(port, gauges) as (stream, name):
        title = f"{name}, {stream.rate_hz:g} Hz"
        out.print_status(f"Leave the stand alone for {options.seconds:g} s")
        measured = [measure_health(gauge) for gauge in collect_samples(stream, options.seconds, gauges)]
    states = [gauge_health_state(name, one) for name, one in zip(GAUGE_NAMES, measured, strict=True)]
    if figure is not None:
        from app.reports.figures.gauge_figures import save_health_figure  # loads matplotlib

        save_health_figure(figure, measured, GAUGE_NAMES, title)
    if options.as_json:
        out.print_json(health_document(title, options.seconds, measured, states))
    else:
        _print_health(title, options.seconds, states)
    if any(state.verdict is HealthGrade.BAD for state in states):
        raise typer.Exit(1)


def _print_health(title: str, seconds: float, states: list[GaugeHealthState]) -> None:
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
    title: str, seconds: float, measured: list[GaugeHealth], states: list[GaugeHealthState]
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


def _numbers(health: GaugeHealth) -> dict[str, Any]:
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


def _symptoms(state: GaugeHealthState) -> list[dict[str, str]]:
    return [
        {"code": one.code, "verdict": str(one.grade), "message": one.message, "remedy": one.remedy}
        for one in state.symptoms
    ]
