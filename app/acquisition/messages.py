"""Commands to and events from the engine and the live identification, one JSON document a line."""

from collections.abc import Callable
from enum import StrEnum
from typing import Annotated

import msgspec

from analysis.quantities import Quantity
from app.child_process import json_decoder
from app.runs.metadata import Conditions, RunMetadata
from drivers.clock import TimeBase
from messages.message import EMPTY, Message

_GUESS = 0.2  # relative standard uncertainty above which a number is of no use to an operator


class PullbackState(StrEnum):
    """State of a pullback test; `guidance` has an instruction to the operator for each."""

    CONNECTING = "connecting"
    IDLE = "idle"  # samples flow into the ring; nothing is recorded
    RECENTRE = "recentre"  # the plate stands where its next slip would leave the range of gauge 2
    ZERO = "zero"  # the rest before the pull is being measured; its mean is the zero
    PULLING = "pulling"  # the zero is known: the table is to be pulled back, or is on its way
    HELD = "held"  # pulled back as far as wanted: it is checked for drift
    ARMED = "armed"
    """Held steadily: the release is awaited. One from another state is recorded too, with a remark."""
    RELEASED = "released"
    SLIPPING = "slipping"
    NO_SLIP = "no-slip"  # released, but the plate stays on the table
    TAIL = "tail"
    RECORDING = "recording"  # everything is recorded, whatever the stand does (trigger `none`)
    CLOSING = "closing"


class EndReason(StrEnum):
    """Why a run ended, as stored in the run file."""

    REST = "rest"
    ENOUGH = "enough"
    DURATION = "duration"
    STOPPED = "stopped"
    DEVICE_LOST = "device-lost"
    STALLED = "stalled"
    TRIGGER_TIMEOUT = "trigger-timeout"
    DISK_FULL = "disk-full"
    WRITE_ERROR = "write-error"
    INTERRUPTED = "interrupted"

    @property
    def is_normal(self) -> bool:
        """Tell whether the run came to its end by itself; any other calls for somebody to look."""
        return self in (EndReason.REST, EndReason.ENOUGH, EndReason.DURATION)


class PortSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The port to read, and the device at it."""

    url: str
    protocol: str
    baud: int | None = None
    parity: str | None = None  # that of the calibration file if None, else N
    stop_bits: int | None = None  # the same, else 1
    rate_hz: float | None = None
    device: dict[str, str] = {}  # the device's own settings, `--set KEY=VALUE`, checked by its driver
    relative_url: str = ""
    """Port of the device of gauge 2, where each gauge has a device and a port of its own."""
    simulated: bool = False
    """The owner knows that the device is simulated; one that can be recognised as such needs no such word."""


class RunSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How to record one run."""

    directory: str
    series: str | None = None
    pullback_m: float | None = None
    pullback_tolerance_m: float | None = None
    """How far off the pullback the table may be held; None takes 2 % of it, 0.1 mm at least."""
    plate_mass_kg: float | None = None
    table_mass_kg: float | None = None
    trigger: str = "pullback"
    """`pullback` begins `pretrigger_s` before the release; `none` begins with the next sample."""
    pretrigger_s: float = 1.0
    duration_s: float | None = None
    """After release (trigger `pullback`) or from the start (`none`); None records until rest or enough."""
    trigger_timeout_s: float = 600.0
    operator: str = ""
    note: str = ""
    conditions: Conditions = Conditions()


# --- commands: to the engine -------------------------------------------------------------


class Connect(msgspec.Struct, frozen=True, tag=True):
    """Open the port and let samples flow into the ring. First command of an engine."""

    port: PortSettings
    stand_file: str
    gauges_file: str
    low_latency: bool = False
    directory: str = ""
    """Folder of the runs to come, whose free space `Health` has until the first run says its own."""


class Arm(msgspec.Struct, frozen=True, tag=True):
    """Record `count` runs, each but the first after one that came to its end by itself."""

    run: RunSettings
    count: Annotated[int, msgspec.Meta(ge=1)] = 1


class Stop(msgspec.Struct, frozen=True, tag=True):
    """End the run that is being recorded and keep it."""

    reason: EndReason = EndReason.STOPPED


class Quit(msgspec.Struct, frozen=True, tag=True):
    """End the run if there is one, close the port, end the process."""


Command = Connect | Arm | Stop | Quit


# --- events: from the engine -------------------------------------------------------------


class Connected(msgspec.Struct, frozen=True, tag=True):
    """The device answers and samples flow."""

    device: str
    firmware: str
    rate_hz: float
    ring_path: str
    simulated: bool = False


class StandPosition(msgspec.Struct, frozen=True):
    """Where table and plate stand, and where they should (m, as the gauges read); None where not known."""

    pullback_m: float | None = None  # wanted, from the zero, without sign
    tolerance_m: float = 0.0
    table_zero_m: float | None = None
    relative_zero_m: float | None = None
    held_m: float | None = None  # where the table was held last
    side: int = 0  # side to which the table is pulled: 1 or -1 by the sign of gauge 1, 0 while unknown
    plate_m: float | None = None  # reading of gauge 2 before the pull
    plate_wanted_m: float | None = None
    """Where the plate must be put, while it stands where its next slip does not fit."""
    early_release_m: float | None = None
    """How far the table had been pulled when it was let go too early, until the zero is known again."""
    keeps_run: bool = False  # a run that is stopped now is kept: the table was pulled back


class StateChanged(msgspec.Struct, frozen=True, tag=True):
    """The pullback test came to a new state, `since_s` on the ring's time axis."""

    state: PullbackState
    since_s: float
    note: Message = EMPTY
    position: StandPosition = StandPosition()


class Reconnecting(msgspec.Struct, frozen=True, tag=True):
    """The device is lost or sends nothing intelligible, and is looked for; sent again for each new reason."""

    message: Message


class Reconnected(msgspec.Struct, frozen=True, tag=True):
    """The device is back. A run continues, with rows for missing samples."""

    gap_s: float
    message: Message


class RunStarted(msgspec.Struct, frozen=True, tag=True):
    """A run file is open under its final name."""

    path: str


class RunEnded(msgspec.Struct, frozen=True, tag=True):
    """The run file is closed, verified and on disk."""

    path: str
    ended: EndReason
    samples: int
    missing: int
    missing_estimated: int
    damaged: int
    overloaded: int
    rate_hz: float
    release_s: float | None = None  # on the run's time axis
    message: Message = EMPTY
    time_base: TimeBase = TimeBase()
    remaining: int = 0


class Health(msgspec.Struct, frozen=True, tag=True):
    """State of the stream, sent twice a second."""

    rate_hz: float
    samples: int
    missing: int
    missing_estimated: int
    damaged: int
    overloaded: int
    free_disk_bytes: int | None  # where runs are stored; None where it is not known
    bytes_per_s: float = 0.0  # what a recording writes, journal included; 0 where nothing has come yet


def is_known(quantity: Quantity) -> bool:
    """Tell whether a quantity is more than a first guess: known to a fifth of itself."""
    return quantity.standard_uncertainty <= _GUESS * abs(quantity.value)


class LiveResult(msgspec.Struct, frozen=True, tag=True):
    """Some 25 times a second after the release: what is known of the run so far, None before it can be."""

    time_s: float
    friction_dynamic: Quantity | None = None
    period: Quantity | None = None
    damping_n1: Quantity | None = None
    law: str = ""
    slip_end_s: float | None = None
    narrowing: tuple[str, ...] = ()  # quantities that waiting longer would still narrow
    may_stop: bool = False  # waiting longer does not narrow f_d
    is_enough: bool = False  # nor T, nor n1: a run without a set duration ends now
    friction_dynamic_plate: Quantity | None = None  # before the joint fit gives f_d
    message: Message = EMPTY  # why there are no more of these, where something went wrong


class Failed(msgspec.Struct, frozen=True, tag=True):
    """The engine could not do it: one sentence with the remedy. The engine ends after it."""

    message: Message


Event = (
    Connected
    | StateChanged
    | Reconnecting
    | Reconnected
    | RunStarted
    | RunEnded
    | Health
    | LiveResult
    | Failed
)


decode_command: Callable[[bytes], Command] = json_decoder(Command)
decode_event: Callable[[bytes], Event] = json_decoder(Event)


# --- live identification -----------------------------------------------------------------


class ClockUpdate(msgspec.Struct, frozen=True, tag=True):
    """The time base as it is known by now."""

    time_base: TimeBase


class FollowRun(msgspec.Struct, frozen=True, tag=True):
    """A run was released: identify it from row `first_row` of the ring on, again and again."""

    ring_path: str
    first_row: int  # also the run's number in the answers
    metadata: RunMetadata
    time_base: TimeBase


class EndRun(msgspec.Struct, frozen=True, tag=True):
    """The run has ended: wait for the next."""


class LiveAnswer(msgspec.Struct, frozen=True):
    """What is known of the run that began at row `first_row`."""

    first_row: int
    result: LiveResult


LiveCommand = FollowRun | ClockUpdate | EndRun

decode_live_command: Callable[[bytes], LiveCommand] = json_decoder(LiveCommand)
decode_live_answer: Callable[[bytes], LiveAnswer] = json_decoder(LiveAnswer)
