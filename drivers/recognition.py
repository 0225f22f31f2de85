"""What received bytes are, or look like where no device folder knows them."""

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.envelope import Unwrapper
from drivers.registry import AVAILABLE, DRIVERS
from drivers.source import LineSettings
from messages.i18n import N_
from messages.message import EMPTY, Message, message, option

MIN_PACKETS = 3
"""Fewer frames or lines do not identify a protocol: one can be a coincidence, and the first is often cut."""
CHECKED_SHARE = 0.25
UNCHECKED_SHARE = 0.7
"""Share of the bytes that must be in good frames: with a checksum, which rejects garbage, or without."""
_SHOWN_BYTES = 8
_SHOWN_OF_LINE = 40
_TEXT = frozenset(b"\t\r\n" + bytes(range(0x20, 0x7F)))
_TEXT_SHARE = 0.95
"""Lines with a damaged character in twenty are still recognised as text."""
_PARITY_SHARES = (0.1, 0.9)
"""Share of the bytes that a wrong parity turns into 0: those whose parity bit differs from a stop bit."""
_EXAMINED_BYTES = 1 << 16


@dataclass(frozen=True, slots=True)
class Recognition:
    """A protocol that bytes belong to, and how to record from the device."""

    protocol: str
    share: float
    """Share of the bytes that is in good frames or lines, 0 to 1."""
    packets: int
    channels: int = 2
    settings: dict[str, str] = field(default_factory=dict)
    """The device's own, as `--set` takes them."""
    rate_hz: float | None = None
    """Samples a second by the device's own times, else by when the bytes came; None if neither is known."""
    needs_rate: bool = False  # whether `--rate` must be given, because the device does not send its rate
    remark: Message = EMPTY  # what to check before recording

    @property
    def rate_option(self) -> str:
        """Value of `--rate` to three digits, without an exponent; "" where none is needed or known."""
        return f"{float(f'{self.rate_hz:.3g}'):.6g}" if self.needs_rate and self.rate_hz else ""


@dataclass(frozen=True, slots=True)
class IdentityQuery:
    """A question that asks a silent device who it is, and changes nothing.

    No query holds a character that another known device takes for a command: OpenScale takes x and !, the
    reference firmware S, P and R.
    """

    order: int  # place among the queries of all devices: those with few line settings first
    data: bytes
    line_settings: tuple[LineSettings, ...]
    """Usual ones of such devices."""
    parse: Callable[[bytes], Message | None]
    """Identity in the answer, maybe empty; None while there is no answer."""
    settings: dict[str, str] = field(default_factory=dict)
    """Settings to record with from a device that answers."""
    is_network: bool = False
    """Whether only network addresses are asked, on a connection on which nothing else was asked."""
    channels: int = 0  # gauges of a device that answers; 0: as many as its protocol has


def recognise(data: bytes, duration_s: float | None = None) -> Recognition | None:
    """The most likely protocol of `data` that came in `duration_s`; None if no device folder knows them."""
    found = [one for driver in AVAILABLE if (one := driver.recognise(data, duration_s)) is not None]
    return max(found, key=lambda one: one.share, default=None)


def unless_coincidence(found: Recognition, *, has_checksum: bool) -> Recognition | None:
    """`found`, if it has so many good packets, in such a share of the bytes, that they are no coincidence."""
    least = CHECKED_SHARE if has_checksum else UNCHECKED_SHARE
    return found if found.packets >= MIN_PACKETS and found.share >= least else None


def rate_from_count(samples: int, duration_s: float | None) -> float | None:
    """Samples a second to three digits, from how many came in `duration_s`; None where that is unknown."""
    return float(f"{(samples - 1) / duration_s:.3g}") if duration_s and samples > 1 else None


def which_channels(channels: int) -> Message:
    """Remark on a device that sends more channels than there are gauges."""
    template = N_("of its {channels} channels say which the gauges are: {option} table=N {option} relative=N")
    return message(template, option=option("--set"), channels=channels)


def describe_unreadable(received: bytes, protocol: str, baud: int | None = None) -> Message:
    """Describe what came instead of good data of `protocol` (usual rate `baud`), and what to do."""
    received = b"".join(read.data for read in Unwrapper().feed(received)) or received
    if not received:
        return message("nothing came, check cable and power, and that the device is sending")
    remedy, first = _remedy(received[:_EXAMINED_BYTES], protocol, baud), received[:_SHOWN_BYTES].hex(" ")
    template = N_("received {count} bytes, first {first}, nothing that {protocol} knows: {remedy}")
    return message(template, count=len(received), first=first, protocol=protocol, remedy=remedy)


def describe_unrecognised(received: bytes, *, has_baud: bool) -> Message:
    """Describe unknown bytes (at all baud rates, if the port has any), and what to do."""
    first = received[:_SHOWN_BYTES].hex(" ")
    if is_text(received):
        template = N_(": these are lines such as {line!r}, give --protocol csv and its columns")
        remedy = message(template, line=_second_line(received))
    elif has_parity_errors(received):
        remedy = message(": every other one is 0, as with a wrong parity, try --parity E or O")
    elif has_baud:
        remedy = message(" at any usual baud rate: look up rate and protocol in the device's manual")
    else:
        remedy = message(": set the baud rate where this address gets its bytes from")
    template = N_("{count} bytes came, first {first}, which no built protocol knows{remedy}")
    return message(template, count=len(received), first=first, remedy=remedy)


def printable_share(data: bytes) -> float:
    """Share of `data` that can be printed; 0 without data."""
    return sum(byte in _TEXT for byte in data) / max(len(data), 1)


def is_text(data: bytes) -> bool:
    """Whether nearly all of `data` can be printed."""
    return printable_share(data) >= _TEXT_SHARE


def has_parity_errors(data: bytes) -> bool:
    """Whether `data` are text in which a wrong parity turned many characters into 0."""
    low, high = _PARITY_SHARES
    return bool(data) and low <= data.count(0) / len(data) <= high and is_text(data.replace(b"\0", b""))


def _remedy(received: bytes, protocol: str, baud: int | None) -> Message:
    driver = DRIVERS[protocol]
    explained = driver.explain(received)
    if explained is not None:
        return explained
    found = recognise(received)
    if found is not None and found.protocol != protocol and DRIVERS[found.protocol].frames_title:
        frames = message(DRIVERS[found.protocol].frames_title)
        template = N_("these are {frames}, choose protocol {protocol}")
        return message(template, frames=frames, protocol=found.protocol)
    if is_text(received):
        line = _second_line(received)
        if driver.frames_title:
            return message("these are lines of text such as {line!r}, choose protocol csv", line=line)
        if found is not None and found.protocol == protocol and found.settings:
            given = " ".join(f"--set {key}={value}" for key, value in found.settings.items())
            return message("these are lines such as {line!r}, try {settings}", line=line, settings=given)
        template = N_("these are lines such as {line!r}, set columns, separator and decimal to match")
        return message(template, line=line)
    if has_parity_errors(received):
        return message(
            "this looks like text read with a wrong parity: try --parity N, E or O as the device is set"
        )
    template = N_("check the baud rate and the protocol, or the parity; `slipstand device probe` tries them")
    if baud:
        template = N_(
            "check the baud rate (usual is {baud}) and the protocol, or the parity;"
            " `slipstand device probe` tries them"
        )
    return message(template, baud=baud)


def _second_line(received: bytes) -> str:
    lines = received.splitlines()  # the first is often cut
    return lines[min(1, len(lines) - 1)][:_SHOWN_OF_LINE].decode("ascii", "replace")
