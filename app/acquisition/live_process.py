"""The process of the live identification: `python -m app.acquisition.live_process`, see `LiveClient`.

It computes apart from the engine, so that neither compiled code nor a held interpreter lock can delay a read
of the port. What computes is imported when the pipes are open and the priority is lowered, since that takes
seconds. When stdin ends, the process ends at once: it holds nothing worth keeping.
"""

import importlib
import os

from app.acquisition.messages import LiveAnswer, LiveCommand, decode_live_command
from app.child_process import (
    CommandReader,
    EventSender,
    LineDecoder,
    ignore_session_signals,
    reserve_stdout,
)
from app.log import start_log

_NICE = 5
"""The engine, at 0, gets about three times the processor time of this process where both want it (Linux)."""


def main() -> None:
    """Run until stdin ends."""
    start_log("live")
    ignore_session_signals()
    if hasattr(os, "nice"):
        os.nice(_NICE)
    events: EventSender[LiveAnswer] = EventSender(reserve_stdout(), is_transient=lambda _: True)
    commands: CommandReader[LiveCommand] = CommandReader(
        0, LineDecoder(decode_live_command), on_closed=lambda: os._exit(0)
    )
    follower = importlib.import_module("app.acquisition.live_follower")
    follower.warm_up()
    follower.serve(commands, events)


if __name__ == "__main__":
    main()
