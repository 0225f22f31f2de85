"""Two simulated one-channel devices whose reading is the time at which it was taken."""

from dataclasses import dataclass

import numpy as np

from drivers.envelope import wrap
from drivers.pair.source import PairSource, make_pair
from drivers.registry import find_driver
from drivers.samples import SampleBlock

EPOCH_NS = 5_000_000_000_000
RATES = {"table.rate_hz": "100.0", "relative.rate_hz": "100.0"}


@dataclass(frozen=True)
class Device:
    """Sends lines `time_us,value`, the value being the true time of the reading in microseconds."""

    rate_hz: float = 100.0
    clock_ppm: float = 0.0
    phase_s: float = 0.0
    latency_s: float = 0.0
    jitter_s: float = 0.0
    bursts: float = 0.0
    """Part of the reads that come up to 20 ms late."""

    def reads(
        self, gauge: int, duration_s: float, random: np.random.Generator
    ) -> list[tuple[int, int, bytes]]:
        """(arrival_ns, gauge, line) of all its lines."""
        own_s = np.arange(int(duration_s * self.rate_hz)) / self.rate_hz
        true_s = self.phase_s + own_s * (1 - self.clock_ppm * 1e-6)
        late_s = self.latency_s + random.exponential(self.jitter_s or 1e-12, len(own_s))
        late_s += np.where(random.random(len(own_s)) < self.bursts, 0.02 * random.random(len(own_s)), 0.0)
        arrival_s = np.maximum.accumulate(true_s + late_s)
        return [
            (EPOCH_NS + round(came * 1e9), gauge, b"%d,%d\r\n" % (round(1e6 * own), round(1e6 * true)))
            for own, true, came in zip(own_s, true_s, arrival_s, strict=True)
        ]


def wire_of(devices: tuple[Device, Device], duration_s: float = 20.0, seed: int = 1) -> list[bytes]:
    """Envelopes of both, in the order in which they came."""
    random = np.random.default_rng(seed)
    reads = [read for gauge, device in enumerate(devices) for read in device.reads(gauge, duration_s, random)]
    return [wrap(gauge, arrival_ns, data) for arrival_ns, gauge, data in sorted(reads)]


def pair_source(devices: tuple[Device, Device] | None = None, **settings: str) -> PairSource:
    """As a replay makes it: the rates are those of an earlier recording."""
    rates = devices or (Device(), Device())
    facts = {"table.rate_hz": repr(rates[0].rate_hz), "relative.rate_hz": repr(rates[1].rate_hz)}
    return make_pair(find_driver("csv"), settings, None, facts)


def decode(source: PairSource, pieces) -> list[SampleBlock]:
    return [block for piece in pieces for block in source.decode(piece, 0)]


def lags_s(block: SampleBlock) -> np.ndarray:
    """True lag of gauge 2 in each row that has both readings."""
    both = block.status == 0
    return 1e-6 * (block.counts[both, 1] - block.counts[both, 0])
