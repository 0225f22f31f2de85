"""What window or command line and the engine say to each other: one JSON document a line, typed here."""

from enum import StrEnum

import msgspec


class PullbackState(StrEnum):
    """Where a pullback test stands; each is a sentence to the operator in `app.presenters`."""

    CONNECTING = "connecting"
    IDLE = "idle"
    """Samples flow into the ring; nothing is recorded."""
    ZERO = "zero"
    """Armed and recording the rest before the pull, whose mean is the zero."""
    PULLING = "pulling"
    HELD = "held"
    """Pulled back and steady: release is awaited."""
    SLIPPING = "slipping"
    TAIL = "tail"
    """Both plates move together."""
    CLOSING = "closing"
    """The run file is being completed and checked."""


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


class PortSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which wire to read."""

    url: str
    protocol: str
    baud: int | None = None
    parity: str = "N"
    rate_hz: float | None = None
    device: dict[str, str] = {}
    """The device's own settings, `--set KEY=VALUE`, checked by its driver."""


class RunSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How to record one run."""

    directory: str
    series: str | None = None
    pullback_m: float | None = None
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
    conditions: dict[str, str] = {}


# --- commands: to the engine -------------------------------------------------------------


class Connect(msgspec.Struct, frozen=True, tag=True):
    """Open the port and let samples flow into the ring. First command of an engine."""

    port: PortSettings
    stand_file: str
    gauges_file: str


class Arm(msgspec.Struct, frozen=True, tag=True):
    """Record one run. While one is recorded, this changes nothing but is remarked upon."""

    run: RunSettings


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
    """File that `app.acquisition.ring.RingReader` maps."""


class StateChanged(msgspec.Struct, frozen=True, tag=True):
    """The pullback test came to a new state, `since_s` on the ring's time axis."""

    state: PullbackState
    since_s: float
    note: str = ""
    """What the operator must know, where something did not go as it should."""


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
    release_s: float | None = None
    """On the run's time axis."""
    message: str = ""
    """What went wrong in a sentence, where something did."""


class Health(msgspec.Struct, frozen=True, tag=True):
    """Twice a second: how the stream does."""

    rate_hz: float
    samples: int
    missing: int
    missing_estimated: int
    damaged: int
    overloaded: int
    free_disk_bytes: int


class Failed(msgspec.Struct, frozen=True, tag=True):
    """The engine could not do it: one sentence with the remedy. The engine ends after it."""

    message: str


Event = Connected | StateChanged | RunStarted | RunEnded | Health | Failed


_COMMANDS: msgspec.json.Decoder[Command] = msgspec.json.Decoder(Command)
_EVENTS: msgspec.json.Decoder[Event] = msgspec.json.Decoder(Event)


def encode(message: Command | Event) -> bytes:
    """One line, newline included."""
    return msgspec.json.encode(message) + b"\n"


def decode_command(line: bytes) -> Command:
    """Parse one line of the command channel. Raises msgspec.ValidationError."""
    return _COMMANDS.decode(line)


def decode_event(line: bytes) -> Event:
    """Parse one line of the event channel. Raises msgspec.ValidationError."""
    return _EVENTS.decode(line)
