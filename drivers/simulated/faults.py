"""Faults of the simulated device: damaged frames at random, and disturbances at given times."""

import math
import random
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum

import numpy as np

from drivers.arrays import Floats
from drivers.errors import SettingsError
from messages.i18n import N_


class FrameFault(StrEnum):
    """What happened to a frame."""

    DROP = "drop"  # a byte is missing, or the end of a line
    FLIP = "flip"  # a bit is wrong, or the end of a line is another character
    TRUNCATE = "truncate"  # its end is missing
    MERGED = "merged"  # the line before lost its end and runs into this one
    GARBAGE = "rubbish"  # random bytes were sent instead
    CUT = "cut"  # the port did not take all of it
    NO_READER = "unheard"
    STALL = "stall"


LOSING_FAULTS = (FrameFault.CUT, FrameFault.NO_READER, FrameFault.STALL)
"""Faults after which a frame is not on the wire, or not all of it."""

LASTING_FAULTS = (FrameFault.NO_READER, FrameFault.STALL, FrameFault.GARBAGE)
"""Faults that last for many frames."""


@dataclass(frozen=True, slots=True)
class FaultRates:
    """Fractions of the frames that lose a byte, have a bit flipped, or lose their end; 0 to 1 together."""

    drop: float = 0.0
    flip: float = 0.0
    truncate: float = 0.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                template = N_("{name} = {value:g} is no fraction of the frames: give 0 to 1")
                raise SettingsError(template, name=name, value=value)
        if self.drop + self.flip + self.truncate > 1.0:
            template = N_(
                "drop {drop:g}, flip {flip:g}, truncate {truncate:g} are more than all frames:"
                " give 1 at most together"
            )
            raise SettingsError(template, **asdict(self))


class FrameDamager:
    """Damages frames at random; the same `seed` gives the same damage."""

    def __init__(self, rates: FaultRates, line_end: bytes, seed: int | None) -> None:
        self._rates = rates
        self._line_end = line_end
        self._random = random.Random(seed)
        self.is_line_open = False
        """Whether the last line was sent without its end."""

    def damage(self, frame: bytes) -> tuple[bytes, FrameFault | None]:
        is_merged, self.is_line_open = self.is_line_open, False
        rates = self._rates
        draw = self._random.random()
        if draw < rates.drop + rates.flip:
            at = self._choose_byte(frame)
            end = b"" if self.is_line_open else frame[at + 1 :]
            changed = b"" if draw < rates.drop or self.is_line_open else self._flip_bit(frame[at])
            return frame[:at] + changed + end, FrameFault.DROP if draw < rates.drop else FrameFault.FLIP
        if draw < rates.drop + rates.flip + rates.truncate:
            self.is_line_open = bool(self._line_end)  # a line loses its end too
            kept = self._random.randrange(1, len(frame) - len(self._line_end))
            return frame[:kept], FrameFault.TRUNCATE
        return frame, FrameFault.MERGED if is_merged else None

    def garbage(self, frame: bytes) -> tuple[bytes, FrameFault]:
        data = self._random.randbytes(len(frame))
        self.is_line_open = bool(self._line_end) and data[-1] not in self._line_end
        return data, FrameFault.GARBAGE

    def _flip_bit(self, byte: int) -> bytes:
        # In text, only bits that make another digit or letter: a change of case may mean the same.
        bit = self._random.choice((0, 1, 2, 3, 6)) if self._line_end else self._random.randrange(8)
        return bytes([byte ^ (1 << bit)])

    def _choose_byte(self, frame: bytes) -> int:
        """Position of a byte; the end of a line counts as one byte, because one half still ends it."""
        content = len(frame) - len(self._line_end)
        at = self._random.randrange(content + bool(self._line_end))
        self.is_line_open = at == content
        return at


class DisturbanceKind(StrEnum):
    """What happens to a device at some time."""

    STALL = "stall"  # the device sends nothing; its clock and converter go on
    GARBAGE = "rubbish"  # it sends random bytes, as many as its frames would have
    UNPLUG = "unplug"  # its port vanishes and comes back; the device has its own power and goes on
    POWER = "power"  # its port vanishes and comes back, and the device was without power meanwhile
    JUMP = "jump"  # the device's time leaps by so many seconds, forward or back


@dataclass(frozen=True, slots=True)
class Disturbance:
    """One disturbance. Raises SettingsError for a length that is not positive, or a jump without one."""

    kind: DisturbanceKind
    seconds: float | None = None
    """How long it lasts, None for ever; of a jump, by how much (s), of either sign."""
    at_s: float | None = None  # stand's own time (s), negative before its motion begins; None: at once

    def __post_init__(self) -> None:
        seconds = self.seconds
        if self.kind is DisturbanceKind.JUMP:
            if seconds is None or not (math.isfinite(seconds) and seconds):
                raise SettingsError("a jump needs its seconds: give for example 'jump -5 at 3'")
        elif seconds is not None and not 0.0 < seconds < math.inf:
            template = N_("{kind} {seconds:g}: give a positive number of seconds, or none for ever")
            raise SettingsError(template, kind=self.kind, seconds=seconds)

    @property
    def end_s(self) -> float:
        return math.inf if self.seconds is None else (self.at_s or 0.0) + self.seconds


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_KINDS = "|".join(DisturbanceKind)
_PATTERN = re.compile(rf"({_KINDS})(?:\s+({_NUMBER}))?(?:\s+at\s+({_NUMBER}))?", re.IGNORECASE)


def parse_disturbance(text: str) -> Disturbance:
    """Parse `KIND [SECONDS] [at SECONDS]`: `unplug 1.5`, `stall`, `jump -5 at 3`. Raises SettingsError."""
    match = _PATTERN.fullmatch(text.strip())
    if match is None:
        template = N_(
            "{text!r} is no fault that is known: give {kinds}, then how many"
            " seconds, then 'at' and when, for example 'unplug 1.5 at 4'"
        )
        raise SettingsError(template, text=text.strip(), kinds=list(DisturbanceKind))
    kind, seconds, at = match.groups()
    at_s = None if at is None else float(at)
    if at_s is not None and not 0.0 <= at_s < math.inf:
        template = N_("{kind} at {at_s:g}: give the seconds after the start, from 0 on")
        raise SettingsError(template, kind=kind, at_s=at_s)
    return Disturbance(DisturbanceKind(kind.lower()), None if seconds is None else float(seconds), at_s)


class DisturbanceSchedule:
    """Disturbances of a device on the stand's own time; those planned happen in each session."""

    def __init__(self, planned: Sequence[Disturbance] = ()) -> None:
        self._planned = tuple(replace(one, at_s=one.at_s or 0.0) for one in planned)
        self.disturbances: tuple[Disturbance, ...] = ()
        """Those of this session, each with its time."""

    def restart(self) -> None:
        self.disturbances = self._planned

    def add(self, disturbance: Disturbance, now_s: float) -> None:
        at_s = now_s if disturbance.at_s is None else disturbance.at_s
        self.disturbances += (replace(disturbance, at_s=at_s),)

    def cable_fault(self, now_s: float) -> DisturbanceKind | None:
        """Why there is no port now, POWER or UNPLUG; None while there is one."""
        return self._first_of((DisturbanceKind.POWER, DisturbanceKind.UNPLUG), now_s)

    def wire_fault(self, time_s: float) -> DisturbanceKind | None:
        """What happens to a frame whose first sample is taken at `time_s`: STALL, GARBAGE or nothing."""
        return self._first_of((DisturbanceKind.STALL, DisturbanceKind.GARBAGE), time_s)

    def clock_offset_s(self, time_s: Floats) -> Floats:
        """Error of the device's time by its jumps (s), (n,), at the stand's times (n,)."""
        offset = np.zeros_like(time_s)
        for one in self.disturbances:
            if one.kind is DisturbanceKind.JUMP:
                offset[time_s >= (one.at_s or 0.0)] += one.seconds or 0.0
        return offset

    def _first_of(self, kinds: Sequence[DisturbanceKind], time_s: float) -> DisturbanceKind | None:
        active = [one.kind for one in self.disturbances if (one.at_s or 0.0) <= time_s < one.end_s]
        return next((kind for kind in kinds if kind in active), None)
