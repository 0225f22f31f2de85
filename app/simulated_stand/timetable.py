"""When the simulated stand does what."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Timetable:
    """Lengths (s) of the parts of one test, in their order."""

    rest_s: float
    pull_s: float
    hold_s: float
    decay_s: float
    recentre_s: float

    @property
    def release_s(self) -> float:
        """From the beginning of a test to its release."""
        return self.rest_s + self.pull_s + self.hold_s

    @property
    def cycle_s(self) -> float:
        """From the beginning of a test to the beginning of the next."""
        return self.release_s + self.decay_s + self.recentre_s
