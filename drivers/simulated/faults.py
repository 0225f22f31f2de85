"""Damage done to frames on their way: bytes dropped and bits flipped, as often as asked."""

import math
import random
from dataclasses import dataclass
from enum import StrEnum

from drivers.errors import SettingsError


class Fault(StrEnum):
    """What happened to a frame."""

    DROP = "drop"
    """A byte is missing, or the end of a line."""
    FLIP = "flip"
    """A bit is wrong, or the end of a line is not one."""
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
            return self._without_a_byte(frame), Fault.DROP
        if draw < self._rates.drop + self._rates.flip:
            return self._with_a_wrong_bit(frame), Fault.FLIP
        return frame, Fault.MERGED if merged else None

    def _without_a_byte(self, frame: bytes) -> bytes:
        at = self._place(frame)
        return frame[:at] if self._ran_on else frame[:at] + frame[at + 1 :]

    def _with_a_wrong_bit(self, frame: bytes) -> bytes:
        at = self._place(frame)
        if self._ran_on:
            return frame[:at]
        # In text, only bits that make another character of it: a case or a blank may pass for the same.
        bit = self._random.choice((0, 1, 2, 3, 6)) if self._line_end else self._random.randrange(8)
        return frame[:at] + bytes([frame[at] ^ (1 << bit)]) + frame[at + 1 :]

    def _place(self, frame: bytes) -> int:
        """Choose a byte; the end of a line counts as one, since either half of it would still end a line."""
        content = len(frame) - len(self._line_end)
        at = self._random.randrange(content + bool(self._line_end))
        self._ran_on = at == content
        return at
