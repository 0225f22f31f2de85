"""Waiting in tests: for a condition, and not for a time."""

import time
from collections.abc import Callable
from typing import TypeVar

Seen = TypeVar("Seen")

PATIENCE_S = 120.0
"""Longest that a test waits for what has to come: a busy machine is slow, and not wrong."""
PATIENCE_MS = round(1e3 * PATIENCE_S)


def wait_until(
    condition: Callable[[], Seen], told: Callable[[], object] = str, pause_s: float = 0.005
) -> Seen:
    """Wait until a condition holds, and return what it gave; fail with what `told` gives."""
    end_s = time.perf_counter() + PATIENCE_S
    while not (seen := condition()):
        assert time.perf_counter() < end_s, f"it did not come within {PATIENCE_S:g} s: {told()}"
        time.sleep(pause_s)
    return seen
