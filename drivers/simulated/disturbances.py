"""What happens to the simulated device at some time: silence, rubbish, a loose cable, a leap of its clock."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from drivers.errors import SettingsError

FloatArray = NDArray[np.float64]


class DisturbanceKind(StrEnum):
    """What happens."""

    STALL = "stall"
    """The device sends nothing; its clock and converter go on."""
    GARBAGE = "rubbish"
    """It sends as many random bytes as its frames would have."""
    UNPLUG = "unplug"
    """Its port vanishes and comes back; the device has its own power and goes on."""
    POWER = "power"
    """Its port vanishes and comes back with a device that was switched off meanwhile."""
    JUMP = "jump"
    """The device's time leaps by so many seconds, forward or back."""


@dataclass(frozen=True, slots=True)
class Disturbance:
    """One of them.

    Attributes
    ----------
    kind : DisturbanceKind
    seconds : float or None
        How long it lasts, None being for ever; of a jump, by how much (s), of either sign.
    at_s : float or None
        When, in seconds of the stand's own time, which is negative before its motion begins; None where that
        is not known yet: at once.

    Raises
    ------
    SettingsError
        For a length that is not positive, or a jump without one.
    """

    kind: DisturbanceKind
    seconds: float | None = None
    at_s: float | None = None

    def __post_init__(self) -> None:
        seconds = self.seconds
        if self.kind is DisturbanceKind.JUMP:
            if seconds is None or not (math.isfinite(seconds) and seconds):
                raise SettingsError("a jump needs its seconds: give for example 'jump -5 at 3'")
        elif seconds is not None and not 0.0 < seconds < math.inf:
            raise SettingsError(
                f"{self.kind} {seconds:g}: give a positive number of seconds, or none for ever"
            )

    @property
    def end_s(self) -> float:
        """When it is over; never, where it lasts for ever."""
        return math.inf if self.seconds is None else (self.at_s or 0.0) + self.seconds


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_KINDS = "|".join(DisturbanceKind)
_SAID = re.compile(rf"({_KINDS})(?:\s+({_NUMBER}))?(?:\s+at\s+({_NUMBER}))?", re.IGNORECASE)


def parse_disturbance(text: str) -> Disturbance:
    """Read `KIND [SECONDS] [at SECONDS]`, for example `unplug 1.5`, `stall`, `jump -5 at 3`.

    Raises
    ------
    SettingsError
        For anything else.
    """
    match = _SAID.fullmatch(text.strip())
    if match is None:
        raise SettingsError(
            f"{text.strip()!r} is no fault that is known: give {', '.join(DisturbanceKind)}, then how many"
            " seconds, then 'at' and when, for example 'unplug 1.5 at 4'"
        )
    kind, seconds, at = match.groups()
    at_s = _number(at)
    if at_s is not None and not 0.0 <= at_s < math.inf:
        raise SettingsError(f"{kind} at {at_s:g}: give the seconds after the start, from 0 on")
    return Disturbance(DisturbanceKind(kind.lower()), _number(seconds), at_s)


def _number(text: str | None) -> float | None:
    return None if text is None else float(text)


class DisturbanceSchedule:
    """All disturbances of a device, on the stand's own time.

    Parameters
    ----------
    planned : sequence of Disturbance
        Happen in each session anew; at its very start where they have no time. None before the first one.
    """

    def __init__(self, planned: Sequence[Disturbance] = ()) -> None:
        self._planned = tuple(replace(one, at_s=one.at_s or 0.0) for one in planned)
        self._disturbances: tuple[Disturbance, ...] = ()

    @property
    def disturbances(self) -> tuple[Disturbance, ...]:
        """Those of this session, each with its time."""
        return self._disturbances

    def restart(self) -> None:
        """Begin a session: only what is planned will happen."""
        self._disturbances = self._planned

    def add(self, disturbance: Disturbance, now_s: float) -> None:
        """Let something happen at its time, or now."""
        at_s = now_s if disturbance.at_s is None else disturbance.at_s
        self._disturbances += (replace(disturbance, at_s=at_s),)

    def cable_fault(self, now_s: float) -> DisturbanceKind | None:
        """Why there is no port now, UNPLUG or POWER; None while there is one."""
        kinds = [one.kind for one in self._during(now_s)]
        return next((k for k in (DisturbanceKind.POWER, DisturbanceKind.UNPLUG) if k in kinds), None)

    def wire_fault(self, time_s: float) -> DisturbanceKind | None:
        """What becomes of a frame whose first sample is taken at `time_s`: STALL, RUBBISH or nothing."""
        kinds = [one.kind for one in self._during(time_s)]
        return next((k for k in (DisturbanceKind.STALL, DisturbanceKind.GARBAGE) if k in kinds), None)

    def clock_offset_s(self, time_s: FloatArray) -> FloatArray:
        """How far off the device's time is after all leaps (s), (n,), at the stand's times (n,)."""
        leap = np.zeros_like(time_s)
        for one in self._disturbances:
            if one.kind is DisturbanceKind.JUMP:
                leap[time_s >= (one.at_s or 0.0)] += one.seconds or 0.0
        return leap

    def _during(self, time_s: float) -> list[Disturbance]:
        return [one for one in self._disturbances if (one.at_s or 0.0) <= time_s < one.end_s]
