"""What a simulated device knows for certain of the bytes it sent."""

from dataclasses import dataclass, field

from drivers.simulated.faults import Fault

DAMAGE_LISTED = 10_000
"""Damaged and lost frames beyond this many are counted, not listed."""


@dataclass(frozen=True, slots=True)
class Damage:
    """One frame that did not arrive whole."""

    first_index: int
    samples: int
    fault: Fault


@dataclass(slots=True)
class WireAccount:
    """Everything since the stream was started: sample index 0 is the first one counted here.

    `frames` and `samples` are those due by the device's clock; of these the damaged ones went out with a
    fault, the lost ones found no room in the port (`cut` includes those it took a part of).
    """

    rate_hz: float
    frames: int = 0
    samples: int = 0
    frames_damaged: int = 0
    samples_damaged: int = 0
    frames_lost: int = 0
    samples_lost: int = 0
    bytes_sent: int = 0
    damage: list[Damage] = field(default_factory=list)

    def add(self, samples: int, fault: Fault | None) -> None:
        """Count the next frame."""
        if fault is Fault.CUT:
            self.frames_lost += 1
            self.samples_lost += samples
        elif fault is not None:
            self.frames_damaged += 1
            self.samples_damaged += samples
        if fault is not None and len(self.damage) < DAMAGE_LISTED:
            self.damage.append(Damage(self.samples, samples, fault))
        self.frames += 1
        self.samples += samples
