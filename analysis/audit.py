"""Consistency of a published table of friction tests with itself and with the equations of motion."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from analysis.motion.two_mass import Motion, MotionError, TwoMassParameters
from analysis.record import AnalysisError
from messages.message import message

KILOGRAM_FORCE_N: Final = 9.80665
FRICTION_RANGE: Final = (0.03, 0.3)
"""Range of f_d in which a residual displacement must be reachable: the range that the paper searched."""
_POSITIVE: Final = ("plate_mass_kg", "stiffness_as_printed", "period_s", "damping_n1_per_s")  # divisors
_FRICTION_STEP: Final = 0.0005  # finds the extremes of the residual displacement to some micrometres
_DURATION_S: Final = 30.0  # first simulated duration; doubled until the last slip has ended


class AuditError(AnalysisError, ValueError):
    """A row that cannot be checked. The message names the series."""


@dataclass(frozen=True, slots=True)
class PublishedRow:
    """A row as printed."""

    series: str
    plate_mass_kg: float
    stiffness_as_printed: float  # in a unit that the print leaves open
    period_s: float
    residual_displacement_m: float
    damping_n1_per_s: float
    damping_n2_per_s: float
    friction_static: float
    friction_dynamic: float
    velocity_max_m_per_s: float
    acceleration_max_m_per_s2: float


@dataclass(frozen=True, slots=True)
class AuditCheck:
    """One printed value beside the expected one, in the same unit."""

    flag: str
    flagged: bool
    printed: float
    expected: float


@dataclass(frozen=True, slots=True)
class AuditedRow:
    """Checks of one row, in the order of `FLAGS`."""

    series: str
    checks: tuple[AuditCheck, ...]

    @property
    def flags(self) -> list[str]:
        return [check.flag for check in self.checks if check.flagged]


def count_flags(rows: Sequence[AuditedRow]) -> dict[str, int]:
    """Number of rows that carry each flag, for all of `FLAGS`."""
    return {flag: sum(flag in row.flags for row in rows) for flag in FLAGS}


@dataclass(frozen=True, slots=True)
class _Case:
    """A row with mass, pullback and gravity of the stand."""

    row: PublishedRow
    table_mass_kg: float
    pullback_m: float
    gravity_m_per_s2: float

    @property
    def mass_kg(self) -> float:
        return self.table_mass_kg + self.row.plate_mass_kg

    def motion(self, friction: float) -> Motion:
        """Simulated until its last slip is over; f_s = f_d = `friction`, no tilt."""
        parameters = TwoMassParameters.from_free_decay(
            period_s=self.row.period_s,
            damping_n1_per_s=self.row.damping_n1_per_s,
            table_mass_kg=self.table_mass_kg,
            plate_mass_kg=self.row.plate_mass_kg,
            friction_dynamic=friction,
            pullback_m=self.pullback_m,
            gravity_m_per_s2=self.gravity_m_per_s2,
        )
        duration_s = _DURATION_S
        while (motion := parameters.simulate(duration_s)).slip_end_s >= duration_s:
            duration_s *= 2.0
        return motion


def audit(
    rows: Sequence[PublishedRow],
    *,
    table_mass_kg: float,
    pullbacks_m: Mapping[str, float],
    gravity_m_per_s2: float = 9.81,
) -> list[AuditedRow]:
    """Check every row of a published table against itself and the equations of motion.

    A value exactly at a limit is not flagged. The flags:

    stiffness_n_per_m, stiffness_kgf_per_m
        T differs by more than 5 % of 2 pi sqrt((m1 + m2) / c) from it; c read as N/m, and as kgf/m.
    damping
        n2 / n1 differs by more than 5 % of (m1 + m2) / m1 from it.
    velocity
        v_max is above 1.10 u0 2 pi / T.
    acceleration
        a_max is above 1.15 times the largest simulated size of u1'' (T, n1 and f_d of the row, f_s = f_d).
    breakaway
        k1^2 u0 is below f_s g, with k1^2 = (2 pi / T)^2 + n1^2: the row could never have slipped.
    residual_within_1_mm, residual_within_2_mm
        u_s differs from the simulated one by no more: findings, not faults. Within 1 mm is within 2 mm too.
    residual_unreachable
        u_s lies outside the range that f_s = f_d from 0.03 to 0.3 gives without tilt. u_s is a continuous
        function of f_d, scanned in steps of 0.0005.

    `table_mass_kg` is m1, `gravity_m_per_s2` is g, `pullbacks_m` is u0 of each series code. Raises
    AuditError if a row describes no motion, or its pullback is not given.
    """
    return [
        _audit_row(_Case(row, table_mass_kg, _pullback(row.series, pullbacks_m), gravity_m_per_s2))
        for row in rows
    ]


def _pullback(series: str, pullbacks_m: Mapping[str, float]) -> float:
    if series not in pullbacks_m:
        raise AuditError("series {series!r} has no pullback. Add it to the given pullbacks.", series=series)
    return pullbacks_m[series]


def _audit_row(case: _Case) -> AuditedRow:
    _check_figures(case.row)
    try:
        return AuditedRow(case.row.series, tuple(_checks(case)))
    except MotionError as error:
        raise AuditError(
            "series {series!r} describes no motion: {error}. Correct the row.",
            series=case.row.series,
            error=error,
        ) from error


def _check_figures(row: PublishedRow) -> None:
    """Raise AuditError unless every value is finite, and above zero where it is a divisor."""
    for name, value in list(asdict(row).items())[1:]:
        if not math.isfinite(value) or (name in _POSITIVE and value <= 0.0):
            needed = "a number above 0" if name in _POSITIVE else "a number"
            raise AuditError(
                "series {series!r}: {name} = {value!r} is not {needed}. Correct the row.",
                series=row.series,
                name=name,
                value=value,
                needed=message(needed),
            )


def _checks(case: _Case) -> Iterator[AuditCheck]:
    """All checks, in the order of `FLAGS`."""
    row, omega = case.row, 2.0 * math.pi / case.row.period_s
    for unit, newtons in (("n", 1.0), ("kgf", KILOGRAM_FORCE_N)):
        expected_s = 2.0 * math.pi * math.sqrt(case.mass_kg / (row.stiffness_as_printed * newtons))
        yield _relative_check(f"stiffness_{unit}_per_m", row.period_s, expected_s)
    ratio = row.damping_n2_per_s / row.damping_n1_per_s
    yield _relative_check("damping", ratio, case.mass_kg / case.table_mass_kg)

    printed, expected = row.velocity_max_m_per_s, case.pullback_m * omega
    yield AuditCheck("velocity", printed > 1.10 * expected, printed, expected)
    motion = case.motion(row.friction_dynamic)
    printed, expected = row.acceleration_max_m_per_s2, motion.table_acceleration_max_m_per_s2
    yield AuditCheck("acceleration", printed > 1.15 * expected, printed, expected)
    needed = row.friction_static * case.gravity_m_per_s2
    reached = (omega**2 + row.damping_n1_per_s**2) * case.pullback_m
    yield AuditCheck("breakaway", reached < needed, needed, reached)

    printed, expected = row.residual_displacement_m, motion.residual_displacement_m
    for limit_mm in (1, 2):
        within = abs(printed - expected) <= 1e-3 * limit_mm
        yield AuditCheck(f"residual_within_{limit_mm}_mm", within, printed, expected)
    low, high = FRICTION_RANGE
    frictions = np.linspace(low, high, round((high - low) / _FRICTION_STEP) + 1)
    residuals = [case.motion(friction).residual_displacement_m for friction in frictions.tolist()]
    nearest = min(max(printed, min(residuals)), max(residuals))
    yield AuditCheck("residual_unreachable", nearest != printed, printed, nearest)


def _relative_check(flag: str, printed: float, expected: float) -> AuditCheck:
    return AuditCheck(flag, abs(printed / expected - 1.0) > 0.05, printed, expected)


FLAGS: Final = (
    "stiffness_n_per_m",
    "stiffness_kgf_per_m",
    "damping",
    "velocity",
    "acceleration",
    "breakaway",
    "residual_within_1_mm",
    "residual_within_2_mm",
    "residual_unreachable",
)
"""All flags, in the order of the checks."""
