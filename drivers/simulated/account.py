"""What a simulated device knows for certain of the bytes it sent."""

from dataclasses import dataclass, field, replace

from drivers.simulated.faults import LASTING_FAULTS, LOSING_FAULTS, FrameFault

MAX_DAMAGE_LISTED = 10_000
"""Damaged and lost stretches beyond this many are counted, not listed."""


@dataclass(frozen=True, slots=True)
class DamagedStretch:
    """One frame that did not arrive whole, or all in a row that fell to one lasting fault."""

    first_index: int
    samples: int
    fault: FrameFault


@dataclass(slots=True)
class TransmissionLog:
    """Everything since the stream was started: sample index 0 is the first one counted here.

    `frames` and `samples` are those due by the device's clock; of these the damaged ones went out with a
    fault, the lost ones not at all (those that the port took a part of included).
    """

    rate_hz: float
    """What the device says that it sends."""
    true_rate_hz: float
    """Samples a second of the stand's own time."""
    started_s: float = 0.0
    """When sample 0 was taken, on the stand's own time."""
    frames: int = 0
    samples: int = 0
    frames_damaged: int = 0
    samples_damaged: int = 0
    frames_lost: int = 0
    samples_lost: int = 0
    samples_clipped: int = 0
    """Readings of either gauge beyond its range, arrived or not."""
    samples_flagged: int = 0
    """In frames that went out whole with an overload flag."""
    bytes_sent: int = 0
    damage: list[DamagedStretch] = field(default_factory=list)

    def add(self, samples: int, fault: FrameFault | None) -> None:
        """Count the next frame."""
        if fault is not None:
            self._add_fault(samples, fault)
        self.frames += 1
        self.samples += samples

    def _add_fault(self, samples: int, fault: FrameFault) -> None:
        if fault in LOSING_FAULTS:
            self.frames_lost += 1
            self.samples_lost += samples
        else:
            self.frames_damaged += 1
            self.samples_damaged += samples
        last = self.damage[-1] if self.damage else None
        if (
            last
            and fault in LASTING_FAULTS
            and last.fault is fault
            and last.first_index + last.samples == self.samples
        ):
            self.damage[-1] = replace(last, samples=last.samples + samples)
        elif len(self.damage) < MAX_DAMAGE_LISTED:
            self.damage.append(DamagedStretch(self.samples, samples, fault))
