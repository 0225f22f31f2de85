"""Options of a stand, a contact and a pullback, as `simulate` and `plan` take them."""

import dataclasses
import math
from typing import Annotated

from analysis.motion.two_mass import TwoMassParameters
from app.cli.errors import CommandError
from app.cli.options import PlateMass, SeriesCode, TableMass, number
from app.simulated_stand.options import PULLBACK_MAX_M
from config.files import load_stand, published_row

_SAMPLES_MAX = 1e7
"""Seven columns of doubles of so many samples take 0.6 GB, what a small computer can spare."""
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


@dataclasses.dataclass(frozen=True)
class MotionOptions:
    """Parameters of a motion. A field that is None is taken from the series."""

    series: SeriesCode = None
    pullback_m: Annotated[
        float | None, number("--pullback", help="Pullback (m); negative to the other side.")
    ] = None
    table_mass_kg: TableMass = None
    plate_mass_kg: PlateMass = None
    period_s: Annotated[
        float | None, number("--period", above=0.0, help="Damped period of the joint motion (s).")
    ] = None
    stiffness_n_per_m: Annotated[
        float | None, number("--stiffness", above=0.0, help="Stiffness of the elastic plates (N/m).")
    ] = None
    damping_n1_per_s: Annotated[
        float | None, number("--n1", least=0.0, help="Damping constant of the joint motion (1/s).")
    ] = None
    damping_coefficient_kg_per_s: Annotated[
        float | None, number("--damping", least=0.0, help="Damping coefficient (kg/s).")
    ] = None
    friction_dynamic: Annotated[
        float | None, number("--friction", least=0.0, help="Dynamic friction coefficient f_d.")
    ] = None
    friction_static: Annotated[
        float | None, number("--static-friction", least=0.0, help="Static friction f_s; f_d if absent.")
    ] = None
    tilt_rad: Annotated[float, number("--tilt", help="Tilt of the sliding plane (rad).")] = 0.0

    def parameters(self) -> TwoMassParameters:
        """Return the parameters of series and options. Raises CommandError, ConfigError."""
        _check_pullback(self.pullback_m)
        options = dataclasses.asdict(self)
        del options["series"]
        given = {name: value for name, value in options.items() if value is not None}
        values = _series_parameters(self.series) if self.series else {}
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
        return TwoMassParameters(
            **_stiffness_and_damping(values), gravity_m_per_s2=load_stand().gravity_m_per_s2
        )


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
