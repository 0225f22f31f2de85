"""The run writer as a process of its own: `python -m app.runs.writer_process`, fed by `WriterClient`.

HDF5 can crash the process that it runs in, at the close after a full disk above all; the engine and
its journal must not go down with it. Frames come in on stdin, JSON lines go out on stdout. When stdin
ends, the engine is gone: the run is closed as interrupted and the process ends.
"""

import signal
import sys


def main() -> None:
    """Serve until stdin ends. Signals that end a session are left to the engine, whose end is seen here."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    from app.runs.writer_server import WriterServer  # late: slow to import, and signals are ignored by now

    WriterServer(sys.stdin.buffer, sys.stdout.buffer).serve()


if __name__ == "__main__":
    main()
