"""Keeps this computer awake while a run is recorded."""

import contextlib
import shutil
import subprocess
import sys

_CONTINUOUS, _SYSTEM_REQUIRED = 0x8000_0000, 0x1
"""Arguments of SetThreadExecutionState: until it is called again; the display may go dark."""
_END_S = 2.0
_COMMANDS = {
    "darwin": ("caffeinate", "-i"),
    "linux": (
        "systemd-inhibit",
        "--what=sleep:idle",
        "--who=Slipstand",
        "--why=A run is being recorded",
        "--mode=block",
    ),
}
"""Programs of a system that keep it awake as long as another one runs. Not every Linux has it."""


class SleepPrevention:
    """Keeps the computer awake from `begin` to `end`, at most as long as this process lives.

    It is called by one thread, to which Windows binds it. Elsewhere a program of the system does it, and ends
    with its stdin. Where there is none, `drivers.host_time.HostMonitor` reports a sleep afterwards.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def begin(self) -> None:
        """Keep the computer awake; nothing changes where it is kept awake already."""
        if sys.platform == "win32":
            import ctypes

            ctypes.windll.kernel32.SetThreadExecutionState(_CONTINUOUS | _SYSTEM_REQUIRED)
        elif self._process is None:
            program, *options = _COMMANDS.get(sys.platform, ("",))
            found = shutil.which(program)
            if found is not None:
                with contextlib.suppress(OSError):
                    self._process = subprocess.Popen(
                        [found, *options, "cat"],
                        stdin=subprocess.PIPE,
                        stdout=subprocess.DEVNULL,
                        stderr=subprocess.DEVNULL,
                        start_new_session=True,  # Ctrl-C is for the program that records
                    )

    def end(self) -> None:
        """Let the computer sleep again."""
        if sys.platform == "win32":
            import ctypes

            ctypes.windll.kernel32.SetThreadExecutionState(_CONTINUOUS)
        elif self._process is not None:
            process, self._process = self._process, None
            try:
                process.communicate(timeout=_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
