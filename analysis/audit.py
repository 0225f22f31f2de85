"""Consistency of a published table of friction tests with itself and with the equations of motion."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from analysis.motion.two_mass import MotionError, TwoMassMotion, TwoMassParameters
from analysis.record import AnalysisError
from messages.message import message

KILOGRAM_FORCE_N: Final = 9.80665
FRICTION_RANGE: Final = (0.03, 0.3)
"""Range of f_d in which a residual displacement must be reachable: the range that the paper searched."""
_POSITIVE: Final = ("plate_mass_kg", "stiffness_as_printed", "period_s", "damping_n1_per_s")
_FIGURES: Final = (
    *_POSITIVE,
    "residual_displacement_m",
    "damping_n2_per_s",
    "friction_static",
    "friction_dynamic",
    "velocity_max_m_per_s",
    "acceleration_max_m_per_s2",
)
_FRICTION_STEP: Final = 0.0005
"""Finds the extremes of the residual displacement to some micrometres."""
_DURATION_S: Final = 30.0
"""First simulated duration; doubled until the last slip has ended."""


class AuditError(AnalysisError, ValueError):
    """A row that cannot be checked. The message names the series."""


class PublishedRow(Protocol):
    """A row as printed."""

    @property
    def series(self) -> str:
        """Series code."""

    @property
    def plate_mass_kg(self) -> float:
        """m2."""

    @property
    def stiffness_as_printed(self) -> float:
        """Stiffness in a unit that the print leaves open."""

    @property
    def period_s(self) -> float:
        """T of the motion without sliding."""

    @property
    def residual_displacement_m(self) -> float:
        """u_s."""

    @property
    def damping_n1_per_s(self) -> float:
        """n1."""

    @property
    def damping_n2_per_s(self) -> float:
        """n2."""

    @property
    def friction_static(self) -> float:
        """f_s."""

    @property
    def friction_dynamic(self) -> float:
        """f_d."""

    @property
    def velocity_max_m_per_s(self) -> float:
        """v_max."""

    @property
    def acceleration_max_m_per_s2(self) -> float:
        """a_max."""


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
        """Flags of the checks that failed."""
        return [check.flag for check in self.checks if check.flagged]


@dataclass(frozen=True, slots=True)
class AuditReport:
    """The audited table, in its own order."""

    rows: tuple[AuditedRow, ...]

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows that carry each flag, for all of `FLAGS`."""
        return {flag: sum(flag in row.flags for row in self.rows) for flag in FLAGS}


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

    def motion(self, friction: float) -> TwoMassMotion:
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
) -> AuditReport:
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
    return AuditReport(tuple(_audit_row(row, table_mass_kg, pullbacks_m, gravity_m_per_s2) for row in rows))


def _audit_row(
    row: PublishedRow, table_mass_kg: float, pullbacks_m: Mapping[str, float], gravity_m_per_s2: float
) -> AuditedRow:
    if row.series not in pullbacks_m:
        raise AuditError(
            "series {series!r} has no pullback. Add it to the given pullbacks.", series=row.series
        )
    _check_figures(row)
    case = _Case(row, table_mass_kg, pullbacks_m[row.series], gravity_m_per_s2)
    try:
        return AuditedRow(row.series, tuple(check for rule in _RULES for check in rule(case)))
    except MotionError as error:
        raise AuditError(
            "series {series!r} describes no motion: {error}. Correct the row.", series=row.series, error=error
        ) from error


def _check_figures(row: PublishedRow) -> None:
    """Raise AuditError unless every value is finite, and above zero where it is a divisor."""
    for name in _FIGURES:
        value = getattr(row, name)
        if not math.isfinite(value) or (name in _POSITIVE and value <= 0.0):
            needed = "a number above 0" if name in _POSITIVE else "a number"
            raise AuditError(
                "series {series!r}: {name} = {value!r} is not {needed}. Correct the row.",
                series=row.series,
                name=name,
                value=value,
                needed=message(needed),
            )


def _stiffness(case: _Case) -> Iterator[AuditCheck]:
    for unit, newtons in (("n", 1.0), ("kgf", KILOGRAM_FORCE_N)):
        expected_s = 2.0 * math.pi * math.sqrt(case.mass_kg / (case.row.stiffness_as_printed * newtons))
        yield _relative_check(f"stiffness_{unit}_per_m", case.row.period_s, expected_s)


def _damping(case: _Case) -> Iterator[AuditCheck]:
    ratio = case.row.damping_n2_per_s / case.row.damping_n1_per_s
    yield _relative_check("damping", ratio, case.mass_kg / case.table_mass_kg)


def _velocity(case: _Case) -> Iterator[AuditCheck]:
    printed = case.row.velocity_max_m_per_s
    expected = case.pullback_m * 2.0 * math.pi / case.row.period_s
    yield AuditCheck("velocity", printed > 1.10 * expected, printed, expected)


def _acceleration(case: _Case) -> Iterator[AuditCheck]:
    printed = case.row.acceleration_max_m_per_s2
    expected = case.motion(case.row.friction_dynamic).table_acceleration_max_m_per_s2
    yield AuditCheck("acceleration", printed > 1.15 * expected, printed, expected)


def _breakaway(case: _Case) -> Iterator[AuditCheck]:
    k1_squared = (2.0 * math.pi / case.row.period_s) ** 2 + case.row.damping_n1_per_s**2
    needed = case.row.friction_static * case.gravity_m_per_s2
    reached = k1_squared * case.pullback_m
    yield AuditCheck("breakaway", reached < needed, needed, reached)


def _residual(case: _Case) -> Iterator[AuditCheck]:
    printed = case.row.residual_displacement_m
    expected = case.motion(case.row.friction_dynamic).residual_displacement_m
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


_RULES: Final[tuple[Callable[[_Case], Iterator[AuditCheck]], ...]] = (
    _stiffness,
    _damping,
    _velocity,
    _acceleration,
    _breakaway,
    _residual,
)
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
