"""Plan of a pullback test, and what is measured in it."""

import math
from dataclasses import dataclass

from app.acquisition.messages import EndReason, PullbackState
from app.acquisition.pullback.notes import OperatorNote
from messages.message import EMPTY, Message, joined

_USUAL = 1.5  # largest slip to either side, in pullbacks: no row of Table 1 goes beyond it, on a level stand
_MARGIN = 0.2  # fraction by which the next slip may exceed the last one
_USED = 0.98  # fraction of a gauge's range that is used


@dataclass(frozen=True, slots=True)
class Excursion:
    """How far a plate goes in one test, from where it stood before the pull (m, as gauge 2 reads)."""

    low_m: float
    high_m: float


@dataclass(frozen=True, slots=True)
class ObservedSlip:
    """How far the plate went in a run of `series`, from a pullback of `pulled_m` (m, with its sign)."""

    series: str | None
    pulled_m: float
    excursion: Excursion

    def expected_excursion(self, series: str | None, pullback_m: float | None) -> Excursion | None:
        """What the next slip may reach; None in another series, where friction may be another one."""
        if series != self.series:
            return None
        factor = (1.0 + _MARGIN) * abs((pullback_m or self.pulled_m) / self.pulled_m)
        return Excursion(factor * min(self.excursion.low_m, 0.0), factor * max(self.excursion.high_m, 0.0))


@dataclass(frozen=True, slots=True)
class AllowedPlateRange:
    """Readings of gauge 2 (m) between which the plate may stand before a pull; none if low is above high."""

    low_m: float
    high_m: float

    @property
    def exists(self) -> bool:
        return self.low_m <= self.high_m

    def fits(self, plate_m: float, margin_m: float = 0.0) -> bool:
        """Tell whether the next slip fits, from where the plate stands; NaN does."""
        return not (plate_m < self.low_m + margin_m or plate_m > self.high_m - margin_m)

    @property
    def best_m(self) -> float:
        """Where to put the plate: the middle of the gauge, or as near to it as all fits with some room."""
        inset_m = 0.25 * (self.high_m - self.low_m)
        return min(max(0.0, self.low_m + inset_m), self.high_m - inset_m)


def default_excursion(pullback_m: float) -> Excursion:
    """What any slip after a pullback (m, of either sign) may reach, before anything else is known."""
    reach_m = _USUAL * abs(pullback_m)
    return Excursion(-reach_m, reach_m)


def allowed_plate_range(range_m: float, expected: Excursion) -> AllowedPlateRange:
    """Room for the plate before a slip, in a gauge that reads from -range_m to range_m."""
    usable_m = _USED * range_m
    return AllowedPlateRange(-usable_m - expected.low_m, usable_m - expected.high_m)


_USUAL_PULLBACK_M = 0.01
_TOLERANCE = 0.02
_TOLERANCE_MIN_M = 0.1e-3  # of the pullback, where the plan gives none: 2 %, and 0.1 mm at least


@dataclass(frozen=True, slots=True)
class PullbackPlan:
    """What is expected of one test."""

    rate_hz: float
    pullback_m: float | None = None
    """Nominal pullback, of either sign (m); about 10 mm are expected where none is known."""
    duration_s: float | None = None  # time after release; None until rest, or `enough_s`
    trigger_timeout_s: float = math.inf
    enough_s: float = 20.0  # time after release at which waiting longer no longer helps (s)
    tolerance_m: float | None = None
    """How far off the pullback the table may be held; None takes 2 % of it, 0.1 mm at least."""
    pretrigger_s: float = 0.0
    first_index: int = 0  # oldest sample that is kept: nothing is armed until it is as old as the pretrigger
    relative_range_m: float | None = None
    """Gauge 2 reads from minus to plus this (m); None where it is not known."""
    gauge_2_on_base: bool = False
    expected_excursion: Excursion | None = None
    """How far the plate is expected to go; None takes the largest of any plate."""
    side: int = 0  # side to which the table was pulled last: 1, -1, or 0 if unknown
    is_simulated: bool = False  # nobody can touch the stand

    @property
    def target_m(self) -> float | None:
        """Pullback without sign (m); None where none is wanted."""
        return None if self.pullback_m is None else abs(self.pullback_m)

    @property
    def nominal_m(self) -> float:
        """Pullback that limits are made of (m)."""
        return self.target_m or _USUAL_PULLBACK_M

    @property
    def hold_tolerance_m(self) -> float:
        if self.tolerance_m is not None:
            return self.tolerance_m
        return max(_TOLERANCE * self.nominal_m, _TOLERANCE_MIN_M)

    @property
    def plate_range(self) -> AllowedPlateRange | None:
        """Where the plate may stand before the pull; None where the range of gauge 2 is not known."""
        if self.relative_range_m is None:
            return None
        return allowed_plate_range(
            self.relative_range_m, self.expected_excursion or default_excursion(self.nominal_m)
        )

    def note(self, note: OperatorNote) -> Message:
        """Note to the operator, with its remedy unless the stand is simulated."""
        return note.fact if self.is_simulated else joined(note, ". ")


@dataclass(frozen=True, slots=True)
class Transition:
    """The test came to a new state at sample `index`, or has a note on the present one."""

    state: PullbackState
    index: int
    note: Message = EMPTY
    is_stored: bool = False  # the note is about the run itself, and is stored in its file
    end_reason: EndReason | None = None


@dataclass(slots=True)
class PullbackMeasurement:
    """What was found, as sample indices and displacements (m); None where it was not."""

    zero_m: float | None = None
    relative_zero_m: float | None = None
    plate_m: float | None = None  # what gauge 2 itself read at the zero
    held_m: float | None = None
    held_index: int | None = None
    release_index: int | None = None
    release_confirmed: bool = False
    """The table has swung through to the other side, which no hand that lets it down makes it do."""
    slip_end_index: int | None = None
    rest_index: int | None = None
    excursion: Excursion | None = None
    """How far the plate went, from where it stood before the pull, as gauge 2 reads."""

    @property
    def pulled_m(self) -> float:
        """How far the table was held from its zero, with sign; from that of the calibration, if need be."""
        return (self.held_m or 0.0) - (self.zero_m or 0.0)

    @property
    def side(self) -> float:
        return math.copysign(1.0, self.pulled_m)
