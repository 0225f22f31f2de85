"""Marks in the journal: what a recovery must know of a run that nobody could end."""

import contextlib
from collections.abc import Callable

import msgspec

from app.acquisition.errors import JournalError
from app.acquisition.journal.journal import Journal
from app.acquisition.journal.notes import Known, Mark
from app.acquisition.pullback.plan import PullbackMeasurement
from drivers.clock import ClockEstimate

_EVERY_S = 1.0


class CheckpointWriter:
    """Notes what is known whenever that has changed, and once a second.

    Parameters
    ----------
    journal : Journal
    armed_index : int
        Sample from which on a release is waited for.
    rate_hz : float
        Nominal samples a second.
    clock : callable
        Tells how the device's clock goes.
    """

    def __init__(
        self, journal: Journal, armed_index: int, rate_hz: float, clock: Callable[[], ClockEstimate | None]
    ) -> None:
        self._journal = journal
        self._armed_index = armed_index
        self._every = round(_EVERY_S * rate_hz)
        self._clock = clock
        self._known: Known | None = None
        self._due = 0

    def update(self, reads: int, next_index: int, facts: PullbackMeasurement) -> None:
        """Take what is known after so many reads of the journal; `next_index` is of the sample after theirs.

        A journal that fails says so at the next bytes.
        """
        known = msgspec.convert(facts, Known, from_attributes=True)
        if known == self._known and next_index < self._due:
            return
        self._known, self._due = known, next_index + self._every
        clock = self._clock()
        mark = Mark(next_index, self._armed_index, known, reads=reads)
        if clock is not None:
            scale = (clock.scale, clock.scale_standard_uncertainty)
            mark = Mark(next_index, self._armed_index, known, *scale, reads=reads)
        with contextlib.suppress(JournalError):
            self._journal.append_metadata(mark)
