"""Where the plate may stand, so that its next slip stays within the range of gauge 2."""

from dataclasses import dataclass

_USUAL = 1.5
"""Reach of a slip to either side, in pullbacks: no row of Table 1 goes beyond it, on a level stand."""
_MARGIN = 0.2
"""What the next slip may reach beyond the last one, as a part of that."""
_USED = 0.98
"""Part of a gauge's range that is counted upon."""


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
        """Tell whether the plate can stand anywhere."""
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
