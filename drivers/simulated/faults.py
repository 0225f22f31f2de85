"""Damage done to frames on their way: bytes dropped, bits flipped and ends cut off, as often as asked."""

import math
import random
from dataclasses import asdict, dataclass
from enum import StrEnum

from drivers.errors import SettingsError


class FrameFault(StrEnum):
    """What happened to a frame."""

    DROP = "drop"
    """A byte is missing, or the end of a line."""
    FLIP = "flip"
    """A bit is wrong, or the end of a line is not one."""
    TRUNCATE = "truncate"
    """Its end is missing."""
    MERGED = "merged"
    """The line before lost its end, and ran into this one."""
    GARBAGE = "rubbish"
    """Random bytes went out instead."""
    CUT = "cut"
    """The port did not take all of it."""
    NO_READER = "unheard"
    """Nobody had the port open."""
    STALL = "stall"
    """The device said nothing."""


LOSING_FAULTS = (FrameFault.CUT, FrameFault.NO_READER, FrameFault.STALL)
"""Faults that leave nothing, or not all, of a frame on the wire."""

LASTING_FAULTS = (FrameFault.NO_READER, FrameFault.STALL, FrameFault.GARBAGE)
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


class FrameDamager:
    """Damages frames at random, repeatably for one `seed`."""

    def __init__(self, rates: FaultRates, line_end: bytes, seed: int | None) -> None:
        self._rates = rates
        self._line_end = line_end
        self._random = random.Random(seed)
        self.is_line_open = False
        """The line that went out last waits for its end."""

    def damage(self, frame: bytes) -> tuple[bytes, FrameFault | None]:
        """Return the frame as the wire carries it, and what happened to it."""
        merged, self.is_line_open = self.is_line_open, False
        rates = self._rates
        draw = self._random.random()
        if draw < rates.drop:
            return self._without_a_byte(frame), FrameFault.DROP
        if draw < rates.drop + rates.flip:
            return self._with_a_wrong_bit(frame), FrameFault.FLIP
        if draw < rates.drop + rates.flip + rates.truncate:
            return self._cut_short(frame), FrameFault.TRUNCATE
        return frame, FrameFault.MERGED if merged else None

    def garbage(self, frame: bytes) -> tuple[bytes, FrameFault]:
        """Return random bytes in place of a frame."""
        data = self._random.randbytes(len(frame))
        self.is_line_open = bool(self._line_end) and data[-1] not in self._line_end
        return data, FrameFault.GARBAGE

    def _without_a_byte(self, frame: bytes) -> bytes:
        at = self._place(frame)
        return frame[:at] if self.is_line_open else frame[:at] + frame[at + 1 :]

    def _with_a_wrong_bit(self, frame: bytes) -> bytes:
        at = self._place(frame)
        if self.is_line_open:
            return frame[:at]
        # In text, only bits that make another character of it: a case or a blank may pass for the same.
        bit = self._random.choice((0, 1, 2, 3, 6)) if self._line_end else self._random.randrange(8)
        return frame[:at] + bytes([frame[at] ^ (1 << bit)]) + frame[at + 1 :]

    def _cut_short(self, frame: bytes) -> bytes:
        """Leave at least a byte of it, so that it is damaged, not lost; a line loses its end too."""
        self.is_line_open = bool(self._line_end)
        return frame[: self._random.randrange(1, len(frame) - len(self._line_end))]

    def _place(self, frame: bytes) -> int:
        """Choose a byte; the end of a line counts as one, since either half of it would still end a line."""
        content = len(frame) - len(self._line_end)
        at = self._random.randrange(content + bool(self._line_end))
        self.is_line_open = at == content
        return at
