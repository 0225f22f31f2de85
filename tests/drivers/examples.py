"""Streams of all devices for benchmarks and drills, from `examples.py` of their test folders."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from drivers.registry import AVAILABLE
from drivers.source import Decoder

RATE_HZ = 1000.0
Counts = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class WireExample:
    """Frames of known samples, and their decoder."""

    name: str
    decoder: Callable[[], Decoder]
    frames: Callable[[int, Counts], list[bytes]]
    """From the index of the first sample and the counts (n, 2): a frame each."""
    has_checksum: bool
    """One that hardly any damage passes."""
    count_bits: int = 24
    gauges: int = 2
    """Columns of the counts that it sends."""
    leap: int = 500_000
    """Index of the first good sample after garbage."""
    following: int = 1
    """Frames that must follow a good one until its sample is given: some show their end by the next one."""
    envelope: Callable[[int, bytes], bytes] = lambda _, data: data
    """Envelope of a read, from the index of its sample."""


@dataclass(frozen=True, slots=True)
class RecordingExample:
    """How the simulated device is recorded in benchmarks and drills."""

    title: str
    rates_hz: tuple[float, ...] = (1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)
    """To be tried for the highest one without loss."""
    is_exact: bool = True
    """Whether it tells how many samples it has taken while it was unplugged."""
    polled_hz: float | None = None
    """Rate at which a polled device is asked."""
    has_16_bits: bool = False
    """Its converter is narrower than that of the usual calibration."""
    unplugged_hz: float = 1000.0
    """Rate at which it is unplugged."""
    is_pair: bool = False
    """Whether each gauge has a device of its own."""
    settings: dict[str, str] = field(default_factory=dict)
    """Of the device, as `--set` takes them."""
    protocol: str = ""


def wire_examples() -> list[WireExample]:
    """Those of all device folders."""
    return [example for driver in AVAILABLE for example in _examples(driver.package).WIRE]


def recording_examples() -> dict[str, RecordingExample]:
    """By the name of the protocol, and by those of its `VARIANTS`, which have other settings."""
    found = {}
    for driver in AVAILABLE:
        examples = _examples(driver.package)
        every = {driver.name: examples.RECORDING} | getattr(examples, "VARIANTS", {})
        found |= {name: replace(example, protocol=driver.name) for name, example in every.items()}
    return found


def times_s(first: int, counts: Counts) -> NDArray[np.float64]:
    """Device times of samples at `RATE_HZ`."""
    return (first + np.arange(len(counts))) / RATE_HZ


def _examples(package: str):
    return import_module(f"tests.{package}.examples")
