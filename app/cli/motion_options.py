"""Options for a stand, a contact and a pullback, which `simulate` and `plan` share."""

import math
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.errors import CommandError
from app.cli.options import finite, positive

if TYPE_CHECKING:
    from analysis.motion.two_mass import TwoMassParameters

Pullback = Annotated[float | None, typer.Option(help="Pullback (m); negative to the other side.")]
Period = Annotated[float | None, typer.Option(help="Damped period of the joint motion (s).")]
Stiffness = Annotated[float | None, typer.Option(help="Stiffness of the elastic plates (N/m).")]
N1 = Annotated[float | None, typer.Option(help="Damping constant of the joint motion (1/s).")]
Damping = Annotated[float | None, typer.Option(help="Damping coefficient (kg/s).")]
Friction = Annotated[float | None, typer.Option(help="Dynamic friction coefficient f_d.")]
StaticFriction = Annotated[float | None, typer.Option(help="Static friction f_s; f_d if absent.")]
Tilt = Annotated[float, typer.Option(help="Tilt of the sliding plane (rad).")]


def check_numbers(**values: float | None) -> None:
    """Refuse what no option of this name takes. Raises CommandError."""
    for name, value in values.items():
        option = f"--{name.replace('_', '-')}"
        if name in _ANY:
            finite(option, value)
        elif name in _NOT_NEGATIVE:
            finite(option, value, least=0.0)
        else:
            positive(option, value)


def check_samples(duration_s: float, rate_hz: float) -> None:
    """Refuse more samples than the memory of a small computer holds. Raises CommandError."""
    if duration_s * rate_hz > _SAMPLES_MAX:
        samples = f"{duration_s * rate_hz:.3g} samples"
        raise CommandError(f"--duration {duration_s:g} at --rate {rate_hz:g} makes {samples}. Give less")


def two_mass_parameters(code: str | None, **options: float | None) -> "TwoMassParameters":
    """Put together what the series brings and what the options say, by their names. Raises CommandError."""
    from analysis.motion.two_mass import TwoMassParameters
    from config.files import load_stand

    check_numbers(**options)
    _check_pullback(options.get("pullback"))
    given = {_PARAMETERS[name]: value for name, value in options.items() if value is not None}
    values = _of_series(code) if code else {}
    for ours, instead, names in _ALTERNATIVES:
        if ours in given and instead in given:
            raise CommandError(f"{names} say the same in two ways. Give one of them")
        if instead in given:
            values.pop(ours, None)
    values |= given
    instead_of = {ours: instead for ours, instead, _ in _ALTERNATIVES}
    missing = [_ASKED[n] for n in _ASKED if n not in values and instead_of.get(n) not in values]
    if missing:
        raise CommandError(f"{', '.join(missing)} is missing. Give it, or a --series")
    return TwoMassParameters(**_elastic(values), gravity_m_per_s2=load_stand().gravity_m_per_s2)


def _check_pullback(pullback_m: float | None) -> None:
    from app.simulated_stand.options import PULLBACK_MAX_M

    if pullback_m is not None and abs(pullback_m) > PULLBACK_MAX_M:
        raise CommandError(
            f"--pullback {pullback_m:g} m is farther than stands are pulled back. Give metres,"
            f" {-PULLBACK_MAX_M:g} to {PULLBACK_MAX_M:g}"
        )


_SAMPLES_MAX = 1e7
_NOT_NEGATIVE = ("n1", "damping", "friction", "static_friction")
_ANY = ("pullback", "tilt")
_PARAMETERS = {
    "pullback": "pullback_m",
    "table_mass": "table_mass_kg",
    "plate_mass": "plate_mass_kg",
    "period": "period_s",
    "stiffness": "stiffness_n_per_m",
    "n1": "damping_n1_per_s",
    "damping": "damping_coefficient_kg_per_s",
    "friction": "friction_dynamic",
    "static_friction": "friction_static",
    "tilt": "tilt_rad",
}
_ASKED = {
    "pullback_m": "--pullback",
    "table_mass_kg": "--table-mass",
    "plate_mass_kg": "--plate-mass",
    "friction_dynamic": "--friction",
    "period_s": "--period or --stiffness",
    "damping_n1_per_s": "--n1 or --damping",
}
_ALTERNATIVES = (
    ("period_s", "stiffness_n_per_m", "--period and --stiffness"),
    ("damping_n1_per_s", "damping_coefficient_kg_per_s", "--n1 and --damping"),
)


def _of_series(code: str) -> dict[str, float]:
    """What a series code brings: the stand's masses and pullback, and T, n1 and f_d of its Table 1 row."""
    from config.files import load_stand, published_row

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


def _elastic(values: dict[str, float]) -> dict[str, float]:
    """Turn T and n1, where given, into c and mu: c = ((2 pi / T)^2 + n1^2) m, mu = 2 n1 m, m = m1 + m2."""
    rest = dict(values)
    mass = values["table_mass_kg"] + values["plate_mass_kg"]
    if "damping_n1_per_s" in rest:
        rest["damping_coefficient_kg_per_s"] = 2.0 * rest.pop("damping_n1_per_s") * mass
    if "period_s" in rest:
        n1 = rest["damping_coefficient_kg_per_s"] / (2.0 * mass)
        rest["stiffness_n_per_m"] = ((2.0 * math.pi / rest.pop("period_s")) ** 2 + n1**2) * mass
    return rest
