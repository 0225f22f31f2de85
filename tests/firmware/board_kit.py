"""The reference firmware on a simulated board (`simulator/`) whose serial line is a pseudo-terminal."""

import contextlib
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.devices.slipstand_binary.source import SlipstandBinarySource, make_source
from drivers.host_time import host_ns
from drivers.port import Port, open_port
from drivers.samples import SampleBlock

BAUD = 500_000
FIRMWARE = Path(__file__).parents[2] / "firmware"
SIMULATOR = Path(__file__).parent / "simulator"
INCLUDES = Path("/usr/include/simavr")
LIMIT_S = 30.0
"""Patience with a busy machine; nothing here is timed by it."""


def missing_tools() -> str:
    """Why the firmware cannot be tried here; "" if it can."""
    missing = [tool for tool in ("avr-gcc", "make", "cc") if shutil.which(tool) is None]
    missing += [] if (INCLUDES / "sim_avr.h").is_file() else ["libsimavr-dev"]
    return f"{', '.join(missing)} not installed: make firmware-tools" if missing else ""


def run_make(*options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["make", "--no-print-directory", "-s", "-C", str(FIRMWARE), *options],
        capture_output=True,
        text=True,
        check=False,
    )


@dataclass(frozen=True)
class Workshop:
    """Where firmware and simulator are built, each once."""

    place: Path

    @cached_property
    def simulator(self) -> Path:
        program = self.place / "board"
        sources = sorted(str(path) for path in SIMULATOR.glob("*.c"))
        flags = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", f"-I{INCLUDES}"]
        subprocess.run(["cc", *flags, "-o", str(program), *sources, "-lsimavr", "-lelf"], check=True)
        return program

    def firmware(self, converter: str, *options: str) -> Path:
        build = self.place / "-".join((converter, *options))
        made = run_make(f"CONVERTER={converter}", f"BUILD={build}", *options)
        assert made.returncode == 0, made.stderr
        assert made.stderr == ""
        return build / "slipstand-fw.hex"


class Board:
    """A simulated board that runs; made by `running`."""

    def __init__(self, process: "subprocess.Popen[str]", url: str) -> None:
        self._process = process
        self.url = url

    def press_reset(self) -> None:
        self._process.send_signal(signal.SIGUSR1)


@contextlib.contextmanager
def running(
    workshop: Workshop,
    firmware: Path,
    converter: str = "none",
    readings: ArrayLike | None = None,
    bootloader: bool = False,
) -> Iterator[Board]:
    """The firmware on a board with that converter; fails if it did to it what its data sheet forbids.

    `readings` (n, 2) are what the converter reads, over and over; without them it reads the time (us).
    """
    given = "times"
    if readings is not None:
        given = str(firmware.with_name("readings.txt"))
        np.savetxt(given, readings, fmt="%d")
    words = [str(workshop.simulator), str(firmware), converter, given, *(["bootloader"] * bootloader)]
    faults = firmware.with_name("faults.txt")
    with faults.open("w") as errors:
        process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
        )
        with process:
            assert process.stdout is not None
            yield Board(process, process.stdout.readline().strip())
    assert process.returncode == 0
    assert faults.read_text() == ""


class Listener:
    """Our driver on an open port, and what it has read."""

    def __init__(self, port: Port, rate_hz: float | None = None) -> None:
        self.port = port
        self.source: SlipstandBinarySource = make_source({}, rate_hz)
        self.wire = b""
        self.blocks: list[SampleBlock] = []

    def start(self) -> None:
        self._take(self.source.start(self.port))

    def resume(self) -> None:
        self.blocks += self.source.decode(b"", host_ns())
        self._take(self.source.resume(self.port))

    @property
    def samples(self) -> int:
        return sum(len(block) for block in self.blocks)

    @property
    def counts(self) -> NDArray[np.generic]:
        return np.concatenate([block.counts for block in self.blocks])

    @property
    def status(self) -> NDArray[np.uint8]:
        return np.concatenate([block.status for block in self.blocks])

    @property
    def times_s(self) -> NDArray[np.float64]:
        return np.concatenate(
            [block.device_time_s for block in self.blocks if block.device_time_s is not None]
        )

    def listen_until(self, enough: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + LIMIT_S
        while not enough():
            assert time.monotonic() < deadline_s, f"only {self.samples} samples, {self.source.losses}"
            self._take(self.port.read())

    def listen(self, samples: int) -> None:
        self.listen_until(lambda: self.samples >= samples)

    def _take(self, data: bytes) -> None:
        self.wire += data
        if data:
            self.blocks += self.source.decode(data, host_ns())


@contextlib.contextmanager
def listening(board: Board, rate_hz: float | None = None) -> Iterator[Listener]:
    """Our driver, started; stopped at the end."""
    with open_port(board.url, BAUD) as port:
        listener = Listener(port, rate_hz)
        listener.start()
        yield listener
        listener.source.stop(port)


def ask(port: Port, command: bytes, end: bytes = b"\n") -> bytes:
    """What came after `command` until `end`, that included."""
    deadline_s = time.monotonic() + LIMIT_S
    port.write(command)
    answer = b""
    while end not in answer:
        assert time.monotonic() < deadline_s, answer[:100]
        answer += port.read()
    return answer[: answer.index(end) + len(end)]
