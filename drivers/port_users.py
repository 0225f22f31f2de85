"""Which programs have a port open, as far as the system tells: Linux does, for programs of the same user."""

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PROCESSES = Path("/proc")


@dataclass(frozen=True, slots=True)
class PortUser:
    """A program that has a port open."""

    process: int
    program: str

    def __str__(self) -> str:
        return f"{self.program} (process {self.process})" if self.program else f"process {self.process}"


def port_users(device: str, processes: Path = PROCESSES) -> list[PortUser]:
    """Programs that have `device`, or what it links to, open.

    Parameters
    ----------
    device : str
        Path of a port; of what is none, nobody is known.
    processes : Path
        The folder of processes of Linux; it need not exist.
    """
    if "://" in device:
        return []
    target = os.path.realpath(device)
    return [
        PortUser(int(process.name), _program(process))
        for process in _entries(processes)
        if process.name.isdigit() and any(_leads_to(target, file) for file in _entries(process / "fd"))
    ]


def other_port_users(device: str, processes: Path = PROCESSES) -> list[PortUser]:
    """Programs beside this one that have a serial port open.

    A pseudo-terminal does not count: who made it holds it.
    """
    if not os.path.realpath(device).startswith("/dev/") or os.path.realpath(device).startswith("/dev/pts/"):
        return []
    return [holder for holder in port_users(device, processes) if holder.process != os.getpid()]


def _entries(folder: Path) -> Iterator[Path]:
    with contextlib.suppress(OSError):
        yield from folder.iterdir()


def _leads_to(target: str, file: Path) -> bool:
    with contextlib.suppress(OSError):  # closed meanwhile, or not ours to see
        return os.path.realpath(file) == target
    return False


def _program(process: Path) -> str:
    with contextlib.suppress(OSError):
        return (process / "comm").read_text("utf-8", "replace").strip()
    return ""
