"""Calibration points: counts of a gauge against readings of a dial gauge, checked."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.arrays import Floats
from analysis.formatting import format_number
from analysis.record import AnalysisError
from messages.message import message

IntArray = NDArray[np.int64]

POLYNOMIAL_DEGREES = (1, 2, 3)
_SPACING_SHARE = 0.5  # readings closer than this share of the median spacing belong to one step


class CalibrationError(AnalysisError, ValueError):
    """Readings that cannot be calibrated with."""


@dataclass(frozen=True, eq=False, slots=True)
class CalibrationPoints:
    """Readings in the order in which they were taken; build them with `from_readings`."""

    counts: Floats  # (n,) float64: averages of the device's counts while the table stood still
    dial_m: Floats  # (n,) float64: readings of the dial gauge (m)
    direction: IntArray  # (n,) int64: +1 on the way up (dial readings grow), -1 on the way down
    round_number: IntArray  # (n,) int64: number of the way up and down, from 1

    def __len__(self) -> int:
        return len(self.counts)

    @classmethod
    def from_readings(
        cls,
        counts: ArrayLike,
        dial_m: ArrayLike,
        direction: ArrayLike | None = None,
        round_number: ArrayLike | None = None,
    ) -> Self:
        """Build checked points from readings (n,); direction and round follow from the dial if not given.

        Raises CalibrationError for unequal lengths, values that are not finite, dial readings against their
        direction, and counts that do not follow the dial.
        """
        counts_seen = np.asarray(counts, dtype=np.float64)
        dial = np.asarray(dial_m, dtype=np.float64)
        _check_finite(counts_seen, dial)
        seen_direction, seen_round = (
            _directions_and_rounds(dial) if direction is None or round_number is None else (None, None)
        )
        ways = np.asarray(seen_direction if direction is None else direction, dtype=np.int64)
        rounds = np.asarray(seen_round if round_number is None else round_number, dtype=np.int64)
        if not len(counts_seen) == len(dial) == len(ways) == len(rounds):
            raise CalibrationError(
                "{counts} counts, {dial_readings} dial readings, {directions} directions and {rounds}"
                " rounds do not go together. Give one of each for every reading",
                counts=len(counts_seen),
                dial_readings=len(dial),
                directions=len(ways),
                rounds=len(rounds),
            )
        readings = cls(counts_seen, dial, ways, rounds)
        readings._check_branches()
        return readings

    def branches(self) -> list[IntArray]:
        keys = np.stack((self.round_number, self.direction), axis=1)
        places = [np.flatnonzero((keys == key).all(axis=1)) for key in np.unique(keys, axis=0)]
        return sorted(places, key=lambda place: int(place[0]))

    def steps(self) -> IntArray:
        """Number of the step, from 0 at the lowest, at which each reading (n,) was taken."""
        gaps = [np.abs(np.diff(self.dial_m[branch])) for branch in self.branches()]
        near_m = _SPACING_SHARE * float(np.median(np.concatenate(gaps)))
        steps = np.empty(len(self), dtype=np.int64)
        step, begins_m = -1, -np.inf
        for place in np.argsort(self.dial_m, kind="stable"):
            if self.dial_m[place] - begins_m > near_m:
                step, begins_m = step + 1, self.dial_m[place]
            steps[place] = step
        return steps

    def _check_branches(self) -> None:
        if len(self) < 2 or np.ptp(self.dial_m) == 0.0:
            raise CalibrationError(
                "{count} readings of the dial gauge show one position only. Move the table in"
                " at least three steps",
                count=len(self),
            )
        if np.ptp(self.counts) == 0.0:
            raise CalibrationError(
                "all {count} counts are {counts} though the dial moves. Check that the gauge"
                " is connected and that the right one is read",
                count=len(self),
                counts=format_number(self.counts[0], 10),
            )
        branches = self.branches()
        if not np.isin(self.direction, (1, -1)).all() or max(map(len, branches)) < 2:
            raise CalibrationError(
                "no round has two readings in one direction. Give direction +1 (up) or -1 (down) and the"
                " round as they were, or neither"
            )
        sense = np.sign((self.counts - self.counts.mean()) @ (self.dial_m - self.dial_m.mean()))
        for branch in branches:
            self._check_branch(branch, float(sense))

    def _check_branch(self, branch: IntArray, sense: float) -> None:
        way = int(self.direction[branch[0]])
        for before, after in pairwise(branch):
            if way * (self.dial_m[after] - self.dial_m[before]) <= 0.0:
                raise CalibrationError(
                    "reading {number}: the dial goes from {before_mm} to {after_mm} mm on the way {direction}"
                    " of round {round_number}. Correct the reading, its direction or its round",
                    number=after + 1,
                    before_mm=_mm(self.dial_m[before]),
                    after_mm=_mm(self.dial_m[after]),
                    direction=message("up") if way > 0 else message("down"),
                    round_number=self.round_number[after],
                )
            if sense * way * (self.counts[after] - self.counts[before]) <= 0.0:
                raise CalibrationError(
                    "reading {number}: counts go from {before} to {after} while the dial"
                    " goes from {before_mm} to {after_mm} mm, against all the others. Repeat or leave out"
                    " this reading",
                    number=after + 1,
                    before=format_number(self.counts[before], 10),
                    after=format_number(self.counts[after], 10),
                    before_mm=_mm(self.dial_m[before]),
                    after_mm=_mm(self.dial_m[after]),
                )


def _mm(value_m: float) -> str:
    return f"{value_m * 1e3:.6g}"


def _check_finite(counts: Floats, dial_m: Floats) -> None:
    for what, values in ((message("count"), counts), (message("dial reading"), dial_m)):
        if values.ndim != 1:
            raise CalibrationError(
                "{what}s of shape {shape} are no list. Give one for every reading",
                what=what,
                shape=values.shape,
            )
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            raise CalibrationError(
                "reading {number}: the {what} {value} is not a finite number. Leave it out",
                number=wrong[0] + 1,
                what=what,
                value=values[wrong[0]],
            )


def _directions_and_rounds(dial_m: Floats) -> tuple[IntArray, IntArray]:
    """Direction and round of each reading; every second reversal begins a round."""
    moves = np.sign(np.diff(dial_m)).astype(np.int64)
    still = np.flatnonzero(moves == 0)
    if len(still):
        raise CalibrationError(
            "reading {number}: the dial stays at {dial_mm} mm. Leave one of the two readings out, or"
            " say the direction and round of each",
            number=still[0] + 2,
            dial_mm=_mm(dial_m[still[0]]),
        )
    direction = np.concatenate((moves[:1], moves)) if len(moves) else np.ones(len(dial_m), dtype=np.int64)
    turns = np.concatenate(([0], np.cumsum(np.diff(direction) != 0))) if len(direction) else direction
    return direction, 1 + turns // 2
