"""Runs that follow one another without anybody touching the keyboard."""

import msgspec

from app.acquisition.messages import RunEnded, RunSettings


class RunSequence:
    """What was asked for, and how much of it is left."""

    def __init__(self) -> None:
        self._next: RunSettings | None = None
        self._remaining = 0
        self._done = 0

    @property
    def is_repeat(self) -> bool:
        """Tell whether the run that is recorded now was armed without being asked for."""
        return self._done > 0

    def begin(self, run: RunSettings, count: int) -> None:
        """Take what was asked for; its first run is being recorded."""
        self._next, self._remaining, self._done = next_run(run), count - 1, 0

    def stop(self) -> None:
        """Nothing is to follow."""
        self._remaining = 0

    def next_after(self, ended: RunEnded) -> tuple[RunEnded, RunSettings | None]:
        """Say how many runs follow one that has ended, and what the next one is to be; None if none.

        Only a run that came to its end by itself is followed: any other calls for somebody to look.
        """
        if not ended.ended.is_normal or self._next is None or self._remaining == 0:
            self._remaining = self._done = 0
            return ended, None
        run, remaining = self._next, self._remaining
        self._next, self._remaining, self._done = next_run(run), remaining - 1, self._done + 1
        return msgspec.structs.replace(ended, remaining=remaining), run


def next_run(run: RunSettings) -> RunSettings:
    """The run after `run`: the same, with its run-in number counted up where it has one."""
    number = run.conditions.run_in_number
    if number is None:
        return run
    conditions = run.conditions.replace(run_in_number=number + 1)
    return msgspec.structs.replace(run, conditions=conditions)
