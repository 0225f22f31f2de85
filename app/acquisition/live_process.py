"""The live identification: a process of its own, `python -m app.acquisition.live_process`, see `LiveClient`.

It computes apart from the engine, so that neither compiled code nor a held interpreter lock can delay a
read of the port. Commands come in on stdin, answers go out on stdout (`messages.py`). When stdin
ends, so does the process, in the middle of whatever it does: it holds nothing worth keeping.
"""

import contextlib
import os
import queue
import signal
import sys
import threading
import time
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:  # what computes is imported late: it takes seconds, in which the process already listens
    from app.acquisition.live_follower import RunFollower
    from app.acquisition.messages import LiveCommand

PERIOD_S = 0.04
"""Between two answers, unless computing one takes more than half of it."""
_NICE = 5


def serve(lines: "queue.Queue[bytes]", answers: BinaryIO) -> None:
    """Follow one run after another, for ever, as the lines say."""
    from app.acquisition.errors import RingError
    from app.acquisition.live_follower import RunFollower
    from app.acquisition.messages import FollowRun, decode_live_command
    from app.acquisition.ring import open_ring

    command: LiveCommand | None = None
    while True:
        command = command or decode_live_command(lines.get())
        if isinstance(command, FollowRun):
            with contextlib.suppress(RingError), open_ring(command.ring_path) as ring:
                command = _follow(RunFollower(ring, command), lines, answers)
                continue
        command = None


def _follow(run: "RunFollower", lines: "queue.Queue[bytes]", answers: BinaryIO) -> "LiveCommand":
    """Answer at an even pace until there is another command than that the clock was timed."""
    from app.acquisition.messages import ClockUpdate, decode_live_command, encode_line

    while True:
        while not lines.empty():
            command = decode_live_command(lines.get())
            if not isinstance(command, ClockUpdate):
                return command
            run.update_clock(command)
        began, computed = time.monotonic(), time.process_time()
        answer = run.answer()
        if answer is not None:
            answers.write(encode_line(answer))
            answers.flush()
        # Others get as much of the processor as an answer took.
        time.sleep(max(began + PERIOD_S - time.monotonic(), time.process_time() - computed))


def warm_up() -> None:
    """Compile or load what an identification needs, before there is anything to identify."""
    from analysis.live import LiveIdentification
    from analysis.synthetic import Truth, simulate_record

    made = simulate_record(Truth(friction_static=0.13, tilt_rad=1e-3, rate_hz=500.0, duration_s=4.0))
    LiveIdentification().update(made)


def _hear(stream: BinaryIO, lines: "queue.Queue[bytes]") -> None:
    """Thread: commands, and the end of the process with the end of who gives them."""
    with contextlib.suppress(OSError):
        while line := stream.readline():
            lines.put(line)
    os._exit(0)


def main() -> None:
    """Run until stdin ends."""
    for name in ("SIGINT", "SIGHUP", "SIGBREAK"):  # they reach all of a terminal's processes
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(_NICE)
    lines: queue.Queue[bytes] = queue.Queue()
    stdin = os.fdopen(os.dup(0), "rb")
    threading.Thread(target=_hear, args=(stdin, lines), name="commands", daemon=True).start()
    warm_up()
    with contextlib.suppress(OSError):  # the engine has gone
        serve(lines, sys.stdout.buffer)


if __name__ == "__main__":
    main()
