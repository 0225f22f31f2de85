"""Asking a silent device who it is, in the words of each protocol that has such a question.

Only questions are sent that read: none sets, starts or stops anything, and none holds a character that a
known device takes for a command: OpenScale takes x and !, the reference firmware S, P and R.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from drivers.errors import ProtocolError, SettingsError
from drivers.gsv import commands as gsv
from drivers.harp import messages as harp
from drivers.modbus import frames as modbus
from drivers.probe.listening import ConfigurableLink, LineSettings
from drivers.probe.recognition import Recognition
from drivers.slipstand_binary import commands as slipstand_binary

_ANSWER_S = 0.4
_UNIT, _REGISTER = 1, 0
_REGISTER_REQUEST = modbus.Request(_UNIT, modbus.Function.READ_HOLDING, _REGISTER)


@dataclass(frozen=True, slots=True)
class IdentityQuery:
    """What is sent, at which tunings, and what an answer tells.

    Attributes
    ----------
    protocol : str
    data : bytes
    tunings : tuple of Tuning
        Usual ones of such devices.
    read : callable (bytes) -> str or None
        What the answer says of the device; None if it is no answer.
    """

    protocol: str
    data: bytes
    line_settings: tuple[LineSettings, ...]
    read: Callable[[bytes], str | None]


@dataclass(frozen=True, slots=True)
class IdentifiedDevice:
    """A device that answered, and how the port was set."""

    recognition: Recognition
    line_settings: LineSettings | None


def _slipstand_answer(received: bytes) -> str | None:
    try:
        device = slipstand_binary.find_identity(received)
    except ProtocolError as error:
        return str(error)
    return None if device is None else f"firmware {device.version}, {device.rate_hz:g} Hz"


def _gsv_answer(received: bytes) -> str | None:
    found = gsv.find_response(received)
    return None if found is None else f"firmware {gsv.text_from_response(found[0]) or 'unknown'}"


def _harp_answer(received: bytes) -> str | None:
    said = harp.find_reply(received, harp.Register.WHO_AM_I)
    if said is None:
        return None
    return (
        "" if said.number == harp.WHO_AM_I else f"it is Harp {said.number}, and LoadCells is {harp.WHO_AM_I}"
    )


def _modbus_answer(received: bytes) -> str | None:
    answer = modbus.parse_response(_REGISTER_REQUEST, received)
    if isinstance(answer, modbus.InvalidResponse):
        return None
    return f"unit {_UNIT} answers: choose its register map with --set map=NAME"


IDENTITY_QUERIES = (
    IdentityQuery(
        "slipstand-binary",
        slipstand_binary.IDENTIFY,
        (LineSettings(460800), LineSettings(500000), LineSettings(115200)),
        _slipstand_answer,
    ),
    IdentityQuery("harp", harp.encode_read(harp.Register.WHO_AM_I), (LineSettings(1_000_000),), _harp_answer),
    IdentityQuery(
        "gsv",
        gsv.encode_request(gsv.Code.FIRMWARE),
        (LineSettings(115200), LineSettings(230400)),
        _gsv_answer,
    ),
    IdentityQuery(
        "modbus",
        _REGISTER_REQUEST.encode(),
        tuple(LineSettings(baud, parity) for baud in (115200, 9600, 19200, 38400) for parity in "NE"),
        _modbus_answer,
    ),
)
"""In the order in which they are asked."""


def query_identity(
    link: ConfigurableLink,
    on_progress: Callable[[str], None],
    queries: Iterable[IdentityQuery] = IDENTITY_QUERIES,
    clock: Callable[[], float] = time.monotonic,
) -> IdentifiedDevice | None:
    """Ask one question after the other until one is answered.

    Raises
    ------
    DeviceLostError
        If the port is gone.
    """
    for question in queries:
        for tuning in question.line_settings if link.has_baud else question.line_settings[:1]:
            on_progress(f"asking for {question.protocol}" + (f" at {tuning}" if link.has_baud else ""))
            remark = _ask_once(link, question, tuning, clock)
            if remark is not None:
                found = Recognition(question.protocol, 1.0, 1, remark=remark)
                return IdentifiedDevice(found, tuning if link.has_baud else None)
    return None


def _ask_once(
    link: ConfigurableLink, question: IdentityQuery, tuning: LineSettings, clock: Callable[[], float]
) -> str | None:
    if link.has_baud:
        try:
            link.configure(tuning.baud, tuning.parity)
        except SettingsError:
            return None
    link.write(question.data)
    deadline_s = clock() + _ANSWER_S
    received = b""
    while clock() < deadline_s:
        received += link.read()
        remark = question.read(received)
        if remark is not None:
            return remark
    return None
