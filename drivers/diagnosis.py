"""What bytes look like that a driver could not read, and what to do about it."""

from drivers.envelope import Unwrapper

_SHOWN = 8
_SHOWN_OF_LINE = 40
_TEXT = frozenset(b"\t\r\n" + bytes(range(0x20, 0x7F)))
_TEXT_SHARE = 0.95
_FRAMING_SHARES = (0.1, 0.9)
"""Part of the bytes that a wrong parity turns into 0: those whose parity bit is no stop bit."""
_LOOKED_AT = 1 << 16
_PROBE = "`slipstand device probe` tries them"


def describe_unreadable(received: bytes, protocol: str, baud: int | None = None) -> str:
    """Say what came instead of good data of `protocol` (usual baud rate `baud`), and what to do.

    Of reads that the host has wrapped, what is in the envelopes counts.
    """
    received = b"".join(read.data for read in Unwrapper().feed(received)) or received
    if not received:
        return "nothing came, check cable and power, and that the device is sending"
    first = received[:_SHOWN].hex(" ")
    remedy = _remedy(received[:_LOOKED_AT], protocol, baud)
    return f"received {len(received)} bytes, first {first}, nothing that {protocol} knows: {remedy}"


def describe_unrecognised(received: bytes, has_baud: bool) -> str:
    """Say of bytes that no built protocol knows what they look like, and what to do.

    Parameters
    ----------
    received : bytes
        At least one.
    has_baud : bool
        Whether all likely baud rates of the port were tried; else there is none to try.
    """
    first = received[:_SHOWN].hex(" ")
    said = f"{len(received)} bytes came, first {first}, which no built protocol knows"
    if is_text(received):
        return f"{said}: these are lines such as {_line_of(received)!r}, give --protocol csv and its columns"
    if has_parity_errors(received):
        return f"{said}: every other one is 0, as with a wrong parity, try --parity E or O"
    if has_baud:
        return f"{said} at any usual baud rate: look up rate and protocol in the device's manual"
    return f"{said}: set the baud rate where this address gets its bytes from"


def is_text(data: bytes) -> bool:
    """Whether nearly all of `data` can be printed."""
    return bool(data) and sum(byte in _TEXT for byte in data) >= _TEXT_SHARE * len(data)


def has_parity_errors(data: bytes) -> bool:
    """Whether `data` are text in which a wrong parity turned many characters into 0."""
    low, high = _FRAMING_SHARES
    return bool(data) and low <= data.count(0) / len(data) <= high and is_text(data.replace(b"\0", b""))


def _remedy(received: bytes, protocol: str, baud: int | None) -> str:
    from drivers.modbus.frames import find_exception
    from drivers.probe.recognition import recognise  # loads all decoders, which only a fault needs

    refusal = find_exception(received) if protocol == "modbus" else None
    if refusal is not None:
        return f"the device refuses, {refusal.description}: hold its registers against its manual"
    found = recognise(received)
    if found is not None and found.protocol != protocol and found.protocol != "csv":
        return f"these are {_TITLES[found.protocol]}, choose protocol {found.protocol}"
    if is_text(received):
        suggested = found.settings if found is not None and found.protocol == protocol else {}
        return _remedy_for_text(received, protocol, suggested)
    if has_parity_errors(received):
        return "this looks like text read with a wrong parity: try --parity N, E or O as the device is set"
    usual = f" (usual is {baud})" if baud else ""
    return f"check the baud rate{usual} and the protocol, or the parity; {_PROBE}"


_TITLES = {"slipstand-binary": "Slipstand frames", "gsv": "frames of a GSV", "harp": "Harp events"}


def _remedy_for_text(received: bytes, protocol: str, suggested: dict[str, str]) -> str:
    line = _line_of(received)
    if protocol != "csv":
        return f"these are lines of text such as {line!r}, choose protocol csv"
    if suggested:
        given = " ".join(f"--set {key}={value}" for key, value in suggested.items())
        return f"these are lines such as {line!r}, try {given}"
    return f"these are lines such as {line!r}, set columns, separator and decimal to match"


def _line_of(received: bytes) -> str:
    lines = received.splitlines()
    return lines[min(1, len(lines) - 1)][:_SHOWN_OF_LINE].decode("ascii", "replace")
