"""Damage done to frames on their way: bytes dropped and bits flipped, as often as asked."""

import math
import random
from dataclasses import dataclass
from enum import StrEnum

from drivers.errors import SettingsError


class Fault(StrEnum):
    """What happened to a frame."""

    DROP = "drop"
    """One byte is missing."""
    FLIP = "flip"
    """One bit is wrong."""
    MERGED = "merged"
    """The line before lost its end, and ran into this one."""
    CUT = "cut"
    """The port did not take all of it."""


@dataclass(frozen=True, slots=True)
class FaultRates:
    """Fractions of the frames that lose a byte and that have a bit flipped, 0 to 1 together."""

    drop: float = 0.0
    flip: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("drop", self.drop), ("flip", self.flip)):
            if not (math.isfinite(value) and value >= 0.0):
                raise SettingsError(f"{name} = {value:g} is no fraction of the frames: give 0 to 1")
        if self.drop + self.flip > 1.0:
            raise SettingsError(
                f"drop {self.drop:g} and flip {self.flip:g} are more than all frames: give 1 at most together"
            )


class Damager:
    """Damages frames at random, repeatably for one `seed`."""

    def __init__(self, rates: FaultRates, line_end: bytes, seed: int | None) -> None:
        self._rates = rates
        self._line_end = line_end
        self._random = random.Random(seed)
        self._ran_on = False

    def damage(self, frame: bytes) -> tuple[bytes, Fault | None]:
        """Return the frame as the wire carries it, and what happened to it."""
        merged, self._ran_on = self._ran_on, False
        draw = self._random.random()
        if draw < self._rates.drop:
            at = self._place(frame)
            return frame[:at] + frame[at + 1 :], Fault.DROP
        if draw < self._rates.drop + self._rates.flip:
            at = self._place(frame)
            wrong = frame[at] ^ (1 << self._random.randrange(8))
            return frame[:at] + bytes([wrong]) + frame[at + 1 :], Fault.FLIP
        return frame, Fault.MERGED if merged else None

    def _place(self, frame: bytes) -> int:
        """Choose a byte; of a line's end only the last, since readers do not miss a carriage return."""
        content = len(frame) - len(self._line_end)
        at = self._random.randrange(content + bool(self._line_end))
        if at < content:
            return at
        self._ran_on = True
        return len(frame) - 1
