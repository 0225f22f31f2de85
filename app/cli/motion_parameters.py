"""A motion as `simulate` and `plan` take it from options and a series, and show it."""

import dataclasses
from collections.abc import Iterator
from typing import Any

from analysis.catalogue import ACCELERATION, METRES_PER_SECOND
from analysis.motion.two_mass import TwoMassParameters
from app.cli.errors import CommandError
from app.cli.measurement_options import MotionOptions
from app.simulated_stand.options import PULLBACK_MAX_M
from app.simulated_stand.series_motion import ALTERNATIVES, missing_parameters, resolve_motion

_SAMPLES_MAX = 1e7  # seven columns of doubles of so many samples take 0.6 GB, what a small computer can spare
_OPTIONS = {
    "pullback_m": "--pullback",
    "table_mass_kg": "--table-mass",
    "plate_mass_kg": "--plate-mass",
    "friction_dynamic": "--friction",
    "period_s": "--period or --stiffness",
    "damping_n1_per_s": "--n1 or --damping",
}


def motion_parameters(motion: MotionOptions) -> TwoMassParameters:
    """Return the parameters of series and options. Raises CommandError, ConfigError."""
    _check_pullback(motion.pullback_m)
    options = dataclasses.asdict(motion)
    del options["series"]
    given = {name: value for name, value in options.items() if value is not None}
    for name, instead in ALTERNATIVES.items():
        if name in given and instead in given:
            raise CommandError(
                f"{_OPTIONS[name].replace(' or ', ' and ')} say the same in two ways. Give one of them"
            )
    if not motion.series and (missing := missing_parameters(given)):
        raise CommandError(
            f"{', '.join(_OPTIONS[name] for name in missing)} is missing. Give it, or a --series"
        )
    return resolve_motion(motion.series, given)


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


def largest_rates(document: dict[str, Any], decimals: int) -> Iterator[tuple[str, str]]:
    """Largest velocity, to so many decimals, and acceleration, to one less, of table and plate."""
    for body in ("table", "plate"):
        velocity = METRES_PER_SECOND.text(document[f"{body}_velocity_max_m_per_s"], decimals)
        acceleration = ACCELERATION.text(document[f"{body}_acceleration_max_m_per_s2"], decimals - 1)
        yield f"{body} at most", f"{velocity}, {acceleration}"
