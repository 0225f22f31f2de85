"""How often the engine takes what was read: as seldom as those allow who wait for it."""

import time
from enum import Enum, auto

_EVERY_S = 0.1
_WATCHED_PAUSE_S = 0.015
_PAUSE_S = 0.04
_AWAITING_PAUSE_S = 0.003


class Latency(Enum):
    """How soon what comes must be seen."""

    BATCHED = auto()
    """Nobody at the stand waits for it."""
    INTERACTIVE = auto()
    """It may call for the operator's next step."""
    IMMEDIATE = auto()
    """The table is held and may be let go, which must be told at once."""


class PollSchedule:
    """The pace of an engine. Each time costs about the same, however much came meanwhile.

    Parameters
    ----------
    is_watched : bool
        Somebody looks at the samples, who is to see them within 50 ms.
    """

    def __init__(self, *, low_latency: bool) -> None:
        self._is_watched = low_latency
        self._due_s = 0.0

    def pause_s(self, latency: Latency) -> float:
        """How long bytes may gather in the port before each read (s)."""
        if latency is Latency.IMMEDIATE:
            return _AWAITING_PAUSE_S
        return _WATCHED_PAUSE_S if self._is_watched else _PAUSE_S

    def wait(self, haste: Latency) -> None:
        """Sleep until the next beat is due, where reads may wait for it."""
        if haste is not Latency.BATCHED or self._is_watched:
            return
        time.sleep(max(0.0, self._due_s - time.monotonic()))
        self._due_s = time.monotonic() + _EVERY_S
