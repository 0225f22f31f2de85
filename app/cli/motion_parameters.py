"""Parameters of a motion, as `simulate` and `plan` take them from their options and a series."""

import dataclasses
import math

from analysis.motion.two_mass import TwoMassParameters
from app.cli.errors import CommandError
from app.cli.measurement_options import MotionOptions
from app.simulated_stand.options import PULLBACK_MAX_M
from config.files import load_stand, published_row

_SAMPLES_MAX = 1e7  # seven columns of doubles of so many samples take 0.6 GB, what a small computer can spare
_REQUIRED = {
    "pullback_m": "--pullback",
    "table_mass_kg": "--table-mass",
    "plate_mass_kg": "--plate-mass",
    "friction_dynamic": "--friction",
    "period_s": "--period or --stiffness",
    "damping_n1_per_s": "--n1 or --damping",
}
_ALTERNATIVES = {"period_s": "stiffness_n_per_m", "damping_n1_per_s": "damping_coefficient_kg_per_s"}
"""Pairs of quantities of which each determines the other."""


def motion_parameters(motion: MotionOptions) -> TwoMassParameters:
    """Return the parameters of series and options. Raises CommandError, ConfigError."""
    _check_pullback(motion.pullback_m)
    options = dataclasses.asdict(motion)
    del options["series"]
    given = {name: value for name, value in options.items() if value is not None}
    values = _series_parameters(motion.series) if motion.series else {}
    for name, instead in _ALTERNATIVES.items():
        if name in given and instead in given:
            raise CommandError(
                f"{_REQUIRED[name].replace(' or ', ' and ')} say the same in two ways. Give one of them"
            )
        if instead in given:
            values.pop(name, None)
    values |= given
    missing = [
        option
        for name, option in _REQUIRED.items()
        if name not in values and _ALTERNATIVES.get(name) not in values
    ]
    if missing:
        raise CommandError(f"{', '.join(missing)} is missing. Give it, or a --series")
    return TwoMassParameters(**_stiffness_and_damping(values), gravity_m_per_s2=load_stand().gravity_m_per_s2)


def check_samples(duration_s: float, rate_hz: float) -> None:
    """Refuse more samples than the memory of a small computer holds. Raises CommandError."""
    if duration_s * rate_hz > _SAMPLES_MAX:
        samples = f"{duration_s * rate_hz:.3g} samples"
        raise CommandError(f"--duration {duration_s:g} at --rate {rate_hz:g} makes {samples}. Give less")


def _check_pullback(pullback_m: float | None) -> None:
    if pullback_m is not None and abs(pullback_m) > PULLBACK_MAX_M:
        raise CommandError(
            f"--pullback {pullback_m:g} m is farther than stands are pulled back. Give metres,"
            f" {-PULLBACK_MAX_M:g} to {PULLBACK_MAX_M:g}"
        )


def _series_parameters(code: str) -> dict[str, float]:
    """Masses and pullback of a series on the stand, and T, n1 and f_d of its row in Table 1."""
    stand = load_stand()
    series = stand.series(code)
    row = published_row(series.code)
    return {
        "pullback_m": series.pullback_m,
        "table_mass_kg": stand.table_mass_kg,
        "plate_mass_kg": series.plate_mass_kg,
        "period_s": row.period_s,
        "damping_n1_per_s": row.damping_n1_per_s,
        "friction_dynamic": row.friction_dynamic,
    }


def _stiffness_and_damping(values: dict[str, float]) -> dict[str, float]:
    """Replace T and n1 by c = ((2 pi / T)^2 + n1^2) m and mu = 2 n1 m, where m = m1 + m2."""
    rest = dict(values)
    mass_kg = values["table_mass_kg"] + values["plate_mass_kg"]
    if "damping_n1_per_s" in rest:
        rest["damping_coefficient_kg_per_s"] = 2.0 * rest.pop("damping_n1_per_s") * mass_kg
    if "period_s" in rest:
        n1 = rest["damping_coefficient_kg_per_s"] / (2.0 * mass_kg)
        rest["stiffness_n_per_m"] = ((2.0 * math.pi / rest.pop("period_s")) ** 2 + n1**2) * mass_kg
    return rest
