"""Damage done to frames on their way: bytes dropped, bits flipped and ends cut off, as often as asked."""

import math
import random
from dataclasses import asdict, dataclass
from enum import StrEnum

from drivers.errors import SettingsError


class Fault(StrEnum):
    """What happened to a frame."""

    DROP = "drop"
    """A byte is missing, or the end of a line."""
    FLIP = "flip"
    """A bit is wrong, or the end of a line is not one."""
    TRUNCATE = "truncate"
    """Its end is missing."""
    MERGED = "merged"
    """The line before lost its end, and ran into this one."""
    RUBBISH = "rubbish"
    """Random bytes went out instead."""
    CUT = "cut"
    """The port did not take all of it."""
    UNHEARD = "unheard"
    """Nobody had the port open."""
    STALL = "stall"
    """The device said nothing."""


LOST = (Fault.CUT, Fault.UNHEARD, Fault.STALL)
"""Faults that leave nothing, or not all, of a frame on the wire."""

LASTING = (Fault.UNHEARD, Fault.STALL, Fault.RUBBISH)
"""Faults that take frame after frame."""


@dataclass(frozen=True, slots=True)
class FaultRates:
    """Fractions of the frames that lose a byte, have a bit flipped, or lose their end; 0 to 1 together."""

    drop: float = 0.0
    flip: float = 0.0
    truncate: float = 0.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                raise SettingsError(f"{name} = {value:g} is no fraction of the frames: give 0 to 1")
        if self.drop + self.flip + self.truncate > 1.0:
            said = ", ".join(f"{name} {value:g}" for name, value in asdict(self).items())
            raise SettingsError(f"{said} are more than all frames: give 1 at most together")


class Damager:
    """Damages frames at random, repeatably for one `seed`."""

    def __init__(self, rates: FaultRates, line_end: bytes, seed: int | None) -> None:
        self._rates = rates
        self._line_end = line_end
        self._random = random.Random(seed)
        self.ran_on = False
        """The line that went out last waits for its end."""

    def damage(self, frame: bytes) -> tuple[bytes, Fault | None]:
        """Return the frame as the wire carries it, and what happened to it."""
        merged, self.ran_on = self.ran_on, False
        rates = self._rates
        draw = self._random.random()
        if draw < rates.drop:
            return self._without_a_byte(frame), Fault.DROP
        if draw < rates.drop + rates.flip:
            return self._with_a_wrong_bit(frame), Fault.FLIP
        if draw < rates.drop + rates.flip + rates.truncate:
            return self._cut_short(frame), Fault.TRUNCATE
        return frame, Fault.MERGED if merged else None

    def rubbish(self, frame: bytes) -> tuple[bytes, Fault]:
        """Return random bytes in place of a frame."""
        data = self._random.randbytes(len(frame))
        self.ran_on = bool(self._line_end) and data[-1] not in self._line_end
        return data, Fault.RUBBISH

    def _without_a_byte(self, frame: bytes) -> bytes:
        at = self._place(frame)
        return frame[:at] if self.ran_on else frame[:at] + frame[at + 1 :]

    def _with_a_wrong_bit(self, frame: bytes) -> bytes:
        at = self._place(frame)
        if self.ran_on:
            return frame[:at]
        # In text, only bits that make another character of it: a case or a blank may pass for the same.
        bit = self._random.choice((0, 1, 2, 3, 6)) if self._line_end else self._random.randrange(8)
        return frame[:at] + bytes([frame[at] ^ (1 << bit)]) + frame[at + 1 :]

    def _cut_short(self, frame: bytes) -> bytes:
        """Leave at least a byte of it, so that it is damaged, not lost; a line loses its end too."""
        self.ran_on = bool(self._line_end)
        return frame[: self._random.randrange(1, len(frame) - len(self._line_end))]

    def _place(self, frame: bytes) -> int:
        """Choose a byte; the end of a line counts as one, since either half of it would still end a line."""
        content = len(frame) - len(self._line_end)
        at = self._random.randrange(content + bool(self._line_end))
        self.ran_on = at == content
        return at
