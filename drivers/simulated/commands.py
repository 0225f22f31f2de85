"""What a reader says to the simulated device, taken from its bytes as they come."""

import re
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

_LONGEST = 16
_COMMAND = re.compile(rb"[SPI]|R(\d{1,9})\r?\n")


class CommandKind(Enum):
    """What a command asks for."""

    START = auto()
    STOP = auto()
    IDENTIFY = auto()
    RATE = auto()
    OTHER = auto()
    """What only the protocol knows, and answers by itself."""


@dataclass(frozen=True, slots=True)
class Command:
    """One command, with the rate (Hz) where it carries one, and as its protocol has it."""

    kind: CommandKind
    rate_hz: float = 0.0
    code: int = 0
    parameters: bytes = b""


class CommandParser(Protocol):
    """Finds the commands of a protocol."""

    def feed(self, data: bytes) -> list[Command]:
        """Commands completed by `data`, which is cut anywhere."""


_ORDERS = {b"S": CommandKind.START, b"P": CommandKind.STOP, b"I": CommandKind.IDENTIFY}


class FirmwareCommandParser:
    """Commands of the reference firmware. Finds commands in bytes cut anywhere; passes over what is none."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Command]:
        """Commands completed by `data`."""
        text = self._rest + data
        matches = list(_COMMAND.finditer(text))
        end = matches[-1].end() if matches else 0
        unfinished = text.rfind(b"R", end)
        self._rest = text[unfinished:][:_LONGEST] if unfinished >= 0 else b""
        return [Command(CommandKind.RATE, float(m[1])) if m[1] else Command(_ORDERS[m[0]]) for m in matches]


class NullCommandParser:
    """A device that talks and does not listen."""

    def feed(self, data: bytes) -> list[Command]:  # noqa: ARG002
        """No commands."""
        return []
