"""Health of gauges as texts and figures, for the window and the command line."""

from typing import Final

from analysis.catalogue import MICROMETRE
from analysis.formatting import MINUS, format_value, with_unit
from analysis.gauge_health import GaugeHealth, Hum, diagnose, worst_grade
from app.presenters.base import LabelledValue
from app.presenters.gauge_health_state import GaugeHealthState, SymptomText
from app.presenters.number_text import format_displacement, format_fixed
from messages.i18n import gettext, translate

GAUGE_NAMES: Final = ("gauge 1 (table)", "gauge 2 (relative)")


def _percent(fraction: float, decimals: int) -> str:
    return with_unit(f"{100.0 * fraction:.{decimals}f}", "%")


def gauge_health_state(name: str, health: GaugeHealth) -> GaugeHealthState:
    symptoms = diagnose(health)
    return GaugeHealthState(
        name,
        worst_grade(symptoms),
        tuple(SymptomText(s.code, s.grade, translate(s.message), translate(s.remedy)) for s in symptoms),
        _figures(health, is_moving=any(symptom.code == "moves" for symptom in symptoms)),
        health.spectrum.frequency_hz,
        health.spectrum.density_m_per_sqrt_hz * 1e6,
    )


def _figures(health: GaugeHealth, *, is_moving: bool) -> tuple[LabelledValue, ...]:
    used = health.range_fraction
    drift_uncertainty = 1e6 * health.drift_standard_uncertainty_m_per_min
    drift = format_value(1e6 * health.drift_m_per_min, drift_uncertainty, "µm/min").in_print
    hums = {gettext("hum, {frequency:g} Hz", frequency=hum.frequency_hz): _hum(hum) for hum in health.hum}
    figures = {
        gettext("reading"): format_displacement(health.mean_m, 3),
        gettext("noise, rms"): MINUS if is_moving else _micrometres(health.noise_rms_m),
        gettext("drift"): MINUS if is_moving else drift,
        **hums,
        gettext("range used"): MINUS if used is None else _percent(used, 0),
        gettext("converter step"): _micrometres(health.resolution_m),
        gettext("overloaded"): _percent(health.overload_fraction, 2),
        gettext("clipped"): _percent(health.clipped_fraction, 2),
        gettext("missing"): _percent(health.missing_fraction, 2),
    }
    return tuple(LabelledValue(label, value) for label, value in figures.items())


def _hum(hum: Hum) -> str:
    if hum.amplitude_m is None:
        return gettext("hidden by this rate")
    return _micrometres(hum.amplitude_m) if hum.amplitude_m else gettext("none seen")


def _micrometres(value_m: float) -> str:
    # From the nanometres of a converter's step to the millimetres of a moving table.
    size_um = MICROMETRE.scale * value_m
    return with_unit(f"{size_um:.3g}" if size_um < 100.0 else format_fixed(size_um, 0), MICROMETRE.symbol)
