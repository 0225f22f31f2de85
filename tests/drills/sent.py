"""The counts that a simulated stand has sent, sample by sample, to compare recorded runs with."""

import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.motion import RepeatedPullback, released_motion
from app.simulated_stand.signal import StandSignal
from app.simulated_stand.truth import Truth
from config.files import load_gauges
from drivers.samples import ABSENT
from drivers.simulated.stream_sender import TransmissionLog

_LOOKED_AT = 3
"""Rows that tell where in the signal a stretch begins: its noise makes them unique."""

_MARK_S = 1e9
"""Time of a disturbance that never comes: asked for in order, it is told after all that was asked before."""

_NEARBY = 1000
"""Samples to each side among which one gauge's count is looked for."""


def truth_of_now(stand: SimulatedStand, patience_s: float = 60.0) -> Truth:
    """The truth of this moment, with all that was asked of the stand before. Raises TimeoutError."""
    told, deadline = _count_marks(stand.truth()), time.monotonic() + patience_s
    stand.disturb(f"jump 1 at {_MARK_S:g}")  # changes nothing but makes it tell
    while _count_marks(stand.truth()) == told:
        if time.monotonic() > deadline:
            raise TimeoutError("the stand does not answer")
        time.sleep(0.0005)
    return stand.truth()


def _count_marks(truth: Truth) -> int:
    return sum(one.at_s == _MARK_S for one in truth.disturbances)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Rows of a run without a hole, from row `first` up to `end`, and the sample that `first` was."""

    first: int
    end: int
    stream: int
    sample: int


@dataclass(slots=True)
class _Stream:
    signal: StandSignal
    counts: NDArray[np.int32] = field(default_factory=lambda: np.empty((0, 2), dtype=np.int32))


class Sent:
    """The streams of one session of a stand."""

    def __init__(self) -> None:
        self._streams: dict[float, _Stream] = {}

    def stretches(self, truth: Truth, counts: NDArray[np.int32], status: NDArray[np.uint8]) -> list[Stretch]:
        """Where the good rows of a run come from. Raises ValueError for rows that were never sent.

        Parameters
        ----------
        truth : Truth
            Told after the run.
        counts : (n, 2) int32
        status : (n,) uint8
        """
        good = np.concatenate([[False], (status & int(ABSENT)) == 0, [False]])
        firsts = np.flatnonzero(good[1:] & ~good[:-1])
        ends = np.flatnonzero(good[:-1] & ~good[1:])
        accounts = [*truth.earlier, truth.wire]
        return [
            self._stretch(truth, accounts, counts, int(first), int(end))
            for first, end in zip(firsts, ends, strict=True)
        ]

    def check(self, truth: Truth, counts: NDArray[np.int32], status: NDArray[np.uint8]) -> int:
        """Hold a run over one connection against what was sent; return the sample after its last row.

        A computer that is busy or stands still lets the port run full: what found no room in it must be
        marked, each row in its place, and no more than the stand knows to be lost. Raises ValueError, also
        where no row is good.
        """
        stretches = self.stretches(truth, counts, status)
        if not stretches:
            raise ValueError(f"none of {len(status)} rows is good")
        first = stretches[0]
        absent = len(status) - sum(stretch.end - stretch.first for stretch in stretches)
        lost = [*truth.earlier, truth.wire][first.stream].samples_lost
        if absent > lost:
            raise ValueError(f"{absent} rows are marked, {lost} were lost")
        if any(other.sample - other.first != first.sample - first.first for other in stretches):
            raise ValueError("rows behind a gap are not in their place")
        return first.sample - first.first + len(status)

    def times_s(
        self, truth: Truth, counts: NDArray[np.int32], status: NDArray[np.uint8]
    ) -> NDArray[np.float64]:
        """When the stand took the sample that is in each good row (k,), on its own time.

        For a device that is asked now and then. Raises ValueError for rows that were never taken.
        """
        wanted = counts[(status & int(ABSENT)) == 0]
        found_s = np.full(len(wanted), np.nan)
        for account in [*truth.earlier, truth.wire]:
            taken = self._counts(truth, account)
            keys, order = np.unique(_key(taken), return_index=True)
            at = np.minimum(np.searchsorted(keys, _key(wanted)), len(keys) - 1)
            hit = keys[at] == _key(wanted)
            found_s[hit] = account.started_s + order[at[hit]] / account.true_rate_hz
        if np.isnan(found_s).any():
            raise ValueError(f"good row {int(np.argmax(np.isnan(found_s)))} is none that was ever taken")
        return found_s

    def nearest_s(
        self, truth: Truth, gauge: int, counts: NDArray[np.int32], expected_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """When the stand took a sample of one gauge with this count (k,), nearest to when it is expected.

        NaN where no sample near by has it.
        """
        found_s = np.full(len(counts), np.nan)
        for account in [*truth.earlier, truth.wire]:
            taken = self._counts(truth, account)[:, gauge]
            at = np.rint((expected_s - account.started_s) * account.true_rate_hz).astype(int)
            for away in sorted(range(-_NEARBY, _NEARBY + 1), key=abs, reverse=True):
                place = at + away
                inside = (place >= 0) & (place < len(taken))
                hit = np.zeros(len(counts), dtype=bool)
                hit[inside] = taken[place[inside]] == counts[inside]
                found_s[hit] = account.started_s + place[hit] / account.true_rate_hz
        return found_s

    def _stretch(
        self, truth: Truth, accounts: list[TransmissionLog], counts: NDArray[np.int32], first: int, end: int
    ) -> Stretch:
        wanted = counts[first:end]
        for number in range(len(accounts) - 1, -1, -1):
            sent = self._counts(truth, accounts[number])
            places = np.flatnonzero((sent == wanted[0]).all(axis=1))
            for place in places[places + len(wanted) <= len(sent)].tolist():
                looked_at = wanted[:_LOOKED_AT]  # a run that was cut short may have fewer rows
                if (sent[place : place + len(looked_at)] == looked_at).all():
                    differ = np.flatnonzero((sent[place : place + len(wanted)] != wanted).any(axis=1))
                    if len(differ):
                        raise ValueError(f"row {first + int(differ[0])} is not what was sent")
                    return Stretch(first, end, number, place)
        raise ValueError(f"rows {first} to {end} were never sent")

    def _counts(self, truth: Truth, account: TransmissionLog) -> NDArray[np.int32]:
        """All samples of a stream so far, and a second more: it goes on while the truth is read."""
        stream = self._streams.get(account.started_s)
        if stream is None:
            stream = self._streams[account.started_s] = _Stream(_signal(truth, account))
        lacking = account.samples + round(account.true_rate_hz) - len(stream.counts)
        if lacking > 0:
            more, _ = stream.signal.take(lacking)
            stream.counts = np.concatenate([stream.counts, more])
        return stream.counts


def _key(counts: NDArray[np.int32]) -> NDArray[np.int64]:
    """Both counts as one number."""
    both = counts.astype(np.int64)
    key: NDArray[np.int64] = (both[:, 0] << 32) + both[:, 1]
    return key


def _signal(truth: Truth, account: TransmissionLog) -> StandSignal:
    options, timetable = truth.options, truth.timetable
    released = released_motion(truth.stand, timetable)
    motion = RepeatedPullback(truth.stand.pullback_m, released, timetable, options.plate_offset_m)
    return StandSignal(
        motion, load_gauges(options.gauges_file), options, account.true_rate_hz, account.started_s
    )
