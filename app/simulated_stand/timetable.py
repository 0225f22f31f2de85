"""When the simulated stand does what."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Timetable:
    """Lengths (s) of the parts of one test, in their order, and how tests follow each other.

    Attributes
    ----------
    rest_s, pull_s, hold_s, decay_s, recentre_s : float
        In the last one the table is stilled, and the plate put back if it is its turn.
    every_s : float, optional
        From the beginning of a test to the next; what the parts leave of it is rest. None: at once.
    count : int, optional
        Tests before the stand rests for good; None goes on for ever.
    recentre_every : int
        The plate is put back to the middle after each so many tests; 0 is never.
    """

    rest_s: float
    pull_s: float
    hold_s: float
    decay_s: float
    recentre_s: float
    every_s: float | None = None
    count: int | None = None
    recentre_every: int = 1

    @property
    def release_s(self) -> float:
        """From the beginning of a test to its release."""
        return self.rest_s + self.pull_s + self.hold_s

    @property
    def parts_s(self) -> float:
        """All parts of one test together."""
        return self.release_s + self.decay_s + self.recentre_s

    @property
    def cycle_s(self) -> float:
        """From the beginning of a test to the beginning of the next."""
        return self.parts_s if self.every_s is None else self.every_s
