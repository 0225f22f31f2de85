"""Parameters of a motion from a series of the stand and values that replace its own."""

import math
from collections.abc import Mapping

from analysis.motion.two_mass import MotionError, TwoMassParameters
from config.files import load_stand, published_row
from messages.i18n import N_

ALTERNATIVES = {
    "period_s": "stiffness_n_per_m",
    "damping_n1_per_s": "damping_coefficient_kg_per_s",
}
"""Pairs of quantities of which each determines the other."""
REQUIRED = (
    "pullback_m",
    "table_mass_kg",
    "plate_mass_kg",
    "friction_dynamic",
    *ALTERNATIVES,
)
_OPTIONAL = ("friction_static", "tilt_rad", "gravity_m_per_s2")


def resolve_motion(series: str | None, given: Mapping[str, float]) -> TwoMassParameters:
    """Parameters of `series`, with the values in `given` in place of its own.

    `given` has fields of `TwoMassParameters`, `period_s` or `damping_n1_per_s`. Gravity is that of the stand.
    Raises MotionError, ConfigError.
    """
    known = (*REQUIRED, *ALTERNATIVES.values(), *_OPTIONAL)
    for name in given:
        if name not in known:
            template = N_("{name} is no parameter of a motion: give {known}")
            raise MotionError(template, name=name, known=", ".join(known))
    values = _series_values(series) if series else {}
    for name, instead in ALTERNATIVES.items():
        if name in given and instead in given:
            template = N_("{name} and {instead} say the same in two ways. Give one of them")
            raise MotionError(template, name=name, instead=instead)
        if instead in given:
            values.pop(name, None)
    values |= given
    if missing := missing_parameters(values):
        template = N_("{names} is missing. Give it, or a series")
        raise MotionError(template, names=", ".join(missing))
    gravity = {"gravity_m_per_s2": load_stand().gravity_m_per_s2}
    return TwoMassParameters(**gravity | _stiffness_and_damping(values))


def missing_parameters(values: Mapping[str, float]) -> list[str]:
    """Required parameters that `values` neither hold nor determine."""
    return [name for name in REQUIRED if name not in values and ALTERNATIVES.get(name) not in values]


def _series_values(code: str) -> dict[str, float]:
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
