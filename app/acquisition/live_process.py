"""The live identification: a process of its own, `python -m app.acquisition.live_process`, see `LiveClient`.

It computes apart from the engine, so that neither compiled code nor a held interpreter lock can delay a
read of the port. Commands come in on stdin, answers go out on stdout (`live_messages.py`). When stdin
ends, so does the process, in the middle of whatever it does: it holds nothing worth keeping.
"""

import contextlib
import os
import queue
import signal
import sys
import threading
import time
from typing import BinaryIO

from analysis.live import LiveIdentification
from analysis.synthetic import Truth, record
from app.acquisition.errors import RingError
from app.acquisition.live_following import Following
from app.acquisition.live_messages import Follow, LiveCommand, decode_live_command, encode_line
from app.acquisition.ring import open_ring

PERIOD_S = 0.04
"""Between two answers, unless computing one takes more than half of it."""
_NICE = 5


def serve(commands: "queue.Queue[LiveCommand]", answers: BinaryIO) -> None:
    """Follow one run after another, for ever."""
    while True:
        command = commands.get()
        if isinstance(command, Follow):
            with contextlib.suppress(RingError), open_ring(command.ring_path) as ring:
                _follow(Following(ring, command), commands, answers)


def _follow(run: Following, commands: "queue.Queue[LiveCommand]", answers: BinaryIO) -> None:
    """Answer at an even pace until the next command."""
    while commands.empty():
        began, computed = time.monotonic(), time.process_time()
        answer = run.answer()
        if answer is not None:
            answers.write(encode_line(answer))
            answers.flush()
        # Others get as much of the processor as an answer took.
        time.sleep(max(began + PERIOD_S - time.monotonic(), time.process_time() - computed))


def warm_up() -> None:
    """Compile or load what an identification needs, before there is anything to identify."""
    made = record(Truth(friction_static=0.13, tilt_rad=1e-3, rate_hz=500.0, duration_s=4.0))
    LiveIdentification().update(made)


def _hear(stream: BinaryIO, commands: "queue.Queue[LiveCommand]") -> None:
    """Thread: commands, and the end of the process with the end of who gives them."""
    with contextlib.suppress(Exception):  # whatever is wrong with the pipe: this process is of no use then
        while line := stream.readline():
            commands.put(decode_live_command(line))
    os._exit(0)


def main() -> None:
    """Run until stdin ends."""
    for name in ("SIGINT", "SIGHUP", "SIGBREAK"):  # they reach all of a terminal's processes
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(_NICE)
    commands: queue.Queue[LiveCommand] = queue.Queue()
    stdin = os.fdopen(os.dup(0), "rb")
    threading.Thread(target=_hear, args=(stdin, commands), name="commands", daemon=True).start()
    warm_up()
    with contextlib.suppress(OSError):  # the engine has gone
        serve(commands, sys.stdout.buffer)


if __name__ == "__main__":
    main()
