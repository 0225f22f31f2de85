"""Processes that get no processor time for a while: stopped at random moments (SIGSTOP) and continued."""

import contextlib
import os
import random
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.drills.processes import descendants_of, is_alive

ROLES = {
    "engine": "app.acquisition.engine",
    "writer": "app.runs.writer",
    "live": "app.acquisition.live_client",
    "stand": "app.simulated_stand.process",
}
"""Modules that processes run as, by what they are called here."""

STAND_STOPS_S = (0.2, 1.0)
"""Length of a stop of the stand too, s. One that says nothing for 3 s has stalled, and is told to have."""
STOPS_S = (0.2, 5.0)
_PAUSES_S = (0.05, 0.6)


@dataclass(frozen=True, slots=True)
class Stop:
    """One stop, by the clock `time.monotonic`; it ends later than any time while it lasts."""

    roles: tuple[str, ...]
    began_s: float
    ended_s: float = float("inf")
    sent_samples: int = 0
    """What the stand had sent just before, where it was asked."""


class Starving:
    """Stops processes below this one, one role at a time or all at once, while it is used with `with`.

    Parameters
    ----------
    moments : random.Random
    roles : sequence of str
        Of `ROLES`, whose processes are stopped; without any nothing is done.
    sent_samples : callable, optional
        Asks how many samples the stand has sent, before each stop of the engine.
    """

    def __init__(
        self,
        moments: random.Random,
        roles: tuple[str, ...] = tuple(ROLES),
        sent_samples: Callable[[], int] = lambda: 0,
    ) -> None:
        self.stops: list[Stop] = []
        self._sent_samples = sent_samples
        self._moments = random.Random(moments.random()) if roles else moments
        self._roles = roles
        self._known: set[int] = set()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._starve, name="starving")

    def __enter__(self) -> Self:
        if self._roles:
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending.set()
        if self._roles:
            self._thread.join()

    def readable_samples(self, until_s: float, margin_s: float = 0.3) -> int | None:
        """Samples sent before a stop in or shortly after which the engine was killed; None without one.

        A stand that was stopped too sends what it had not, so the length of a stop does not tell how many
        samples came during it.
        """
        for stop in self.stops:
            if "engine" in stop.roles and stop.began_s < until_s < stop.ended_s + margin_s:
                return stop.sent_samples
        return None

    def _starve(self) -> None:
        while not self._ending.wait(self._moments.uniform(*_PAUSES_S)):
            role = self._moments.choice([*self._roles, "all"])
            self._stop(self._roles if role == "all" else (role,))

    def _stop(self, roles: tuple[str, ...]) -> None:
        processes = self._processes(roles)
        if not processes:
            return
        length_s = self._moments.uniform(*(STAND_STOPS_S if "stand" in roles else STOPS_S))
        sent_samples = self._sent_samples() if "engine" in roles else 0
        self.stops.append(Stop(roles, time.monotonic(), sent_samples=sent_samples))
        try:
            for process_id in processes:
                _send(process_id, signal.SIGSTOP)
            self._ending.wait(length_s)
        finally:
            for process_id in processes:
                _send(process_id, signal.SIGCONT)
        self.stops[-1] = replace(self.stops[-1], ended_s=time.monotonic())

    def _processes(self, roles: tuple[str, ...]) -> list[int]:
        """Those of these roles; also of an engine whose owner is gone, which nobody here has started."""
        self._known = {one for one in self._known if is_alive(one)}
        for one in [os.getpid(), *self._known]:
            self._known.update(descendants_of(one))
        return [one for one in sorted(self._known) if any(is_a(one, role) for role in roles)]


def is_a(process_id: int, role: str) -> bool:
    """Tell whether a process is one of a role of `ROLES`."""
    with contextlib.suppress(OSError):
        return ROLES[role].encode() in Path(f"/proc/{process_id}/cmdline").read_bytes().split(b"\0")
    return False


def _send(process_id: int, number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(process_id, number)
