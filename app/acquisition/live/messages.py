"""What the engine and the process of the live identification say to each other, a JSON document a line."""

import msgspec

from app.acquisition.messages import LiveResult
from app.runs.metadata import RunMetadata


class ClockUpdate(msgspec.Struct, frozen=True, tag=True):
    """How the device's clock is found to go by now, and how much later gauge 2 is read than gauge 1."""

    clock_scale: float
    clock_scale_uncertainty: float
    skew_s: float = 0.0
    skew_standard_uncertainty_s: float = 0.0


class FollowRun(msgspec.Struct, frozen=True, tag=True):
    """A run was released: identify it from row `first_row` of the ring on, again and again."""

    ring_path: str
    first_row: int
    """Also the run's number in the answers."""
    metadata: RunMetadata
    clock: ClockUpdate


class EndRun(msgspec.Struct, frozen=True, tag=True):
    """The run has ended: wait for the next."""


class LiveAnswer(msgspec.Struct, frozen=True):
    """What is known of the run that began at row `first_row`."""

    first_row: int
    result: LiveResult


LiveCommand = FollowRun | ClockUpdate | EndRun

_LIVE_COMMANDS: msgspec.json.Decoder[LiveCommand] = msgspec.json.Decoder(LiveCommand)
_LIVE_ANSWERS: msgspec.json.Decoder[LiveAnswer] = msgspec.json.Decoder(LiveAnswer)


def encode_line(message: LiveCommand | LiveAnswer) -> bytes:
    """One line, newline included."""
    return msgspec.json.encode(message) + b"\n"


def decode_live_command(line: bytes) -> LiveCommand:
    """Parse one line to the process. Raises msgspec.ValidationError."""
    return _LIVE_COMMANDS.decode(line)


def decode_answer(line: bytes) -> LiveAnswer:
    """Parse one line from the process. Raises msgspec.ValidationError."""
    return _LIVE_ANSWERS.decode(line)
