"""What bytes look like that a driver could not read."""

from drivers.slipstand_binary.frames import frames_in

_SHOWN = 8
_SHOWN_OF_LINE = 40
_TEXT = frozenset(b"\t\r\n" + bytes(range(0x20, 0x7F)))
_TEXT_SHARE = 0.95
_ALSO_USUAL = {"slipstand-binary": ", of the Arduino firmware 500000"}


def describe(received: bytes, protocol: str, baud: int | None = None) -> str:
    """Say what came instead of good data of `protocol` (usual baud rate `baud`), and what to do."""
    if not received:
        return "nothing came, check cable and power, and that the device is sending"
    first = received[:_SHOWN].hex(" ")
    remedy = _remedy(received, protocol, baud)
    return f"received {len(received)} bytes, first {first}, nothing that {protocol} knows: {remedy}"


def _remedy(received: bytes, protocol: str, baud: int | None) -> str:
    if protocol != "slipstand-binary" and len(frames_in(received)):
        return "these are Slipstand frames, choose protocol slipstand-binary"
    if sum(byte in _TEXT for byte in received) >= _TEXT_SHARE * len(received):
        return _remedy_for_text(received, protocol)
    usual = f" (usual is {baud}{_ALSO_USUAL.get(protocol, '')})" if baud else ""
    return f"check the baud rate{usual} and the protocol"


def _remedy_for_text(received: bytes, protocol: str) -> str:
    lines = received.splitlines()
    line = lines[min(1, len(lines) - 1)][:_SHOWN_OF_LINE].decode("ascii", "replace")
    if protocol == "csv":
        return f"these are lines such as {line!r}, set columns, separator and decimal to match"
    return f"these are lines of text such as {line!r}, choose protocol csv"
