"""Streams of the Lab Streaming Layer: found, received and sent. The only user of pylsl.

A stream has the address `lsl://NAME`, NAME being its name or source id, or `lsl://?type=TYPE`, or both.
"""

import contextlib
import importlib
import logging
import os
from pathlib import Path
from typing import Any, Self
from urllib.parse import parse_qs, quote, unquote, urlsplit

import numpy as np

from drivers.arrays import Floats
from drivers.errors import DeviceLostError, PortUnavailableError, SettingsError
from drivers.host_time import host_ns
from drivers.source import LineSettings
from drivers.stream_packets import DESCRIBE, StreamDescription, pack_chunk, pack_description
from messages.i18n import N_

_log = logging.getLogger(__name__)

SCHEME = "lsl://"
RESOLVE_S = 3.0
"""How long a stream is searched for; those of this computer answer within 20 ms, others within a second."""
_LIST_S = 1.0
_READ_TIMEOUT_S = 0.05
_OPEN_S = 5.0
_BUFFER_S = 60  # samples wait in liblsl for so long before it drops the oldest
_MAX_SAMPLES = 20_000  # of one read
_CONFIGURATIONS = ("lsl_api.cfg", "~/lsl_api/lsl_api.cfg", "/etc/lsl_api/lsl_api.cfg")
_QUIET = "[log]\nlevel = -3\n"  # nothing: what fails is raised, and liblsl would write to the terminal


def load_pylsl() -> Any:
    """The module pylsl. Raises PortUnavailableError where it, or its library, is not installed."""
    try:
        pylsl = importlib.import_module("pylsl")
    except (ImportError, RuntimeError, OSError) as error:  # RuntimeError: without liblsl
        template = N_("LSL streams need pylsl ({fault}): pip install 'slipstand[lsl]'")
        raise PortUnavailableError(template, fault=str(error).splitlines()[0]) from error
    is_configured = "LSLAPICFG" in os.environ or any(
        Path(one).expanduser().exists() for one in _CONFIGURATIONS
    )
    if not is_configured:
        with contextlib.suppress(NotImplementedError, AttributeError):
            pylsl.set_config_content(_QUIET)
    return pylsl


def find_streams() -> list[tuple[str, str]]:
    """Address and description of each stream of numbers, after a second; none without pylsl."""
    try:
        pylsl = load_pylsl()
    except PortUnavailableError:
        return []
    found = (info for info in pylsl.resolve_streams(_LIST_S) if info.channel_format() != pylsl.cf_string)
    return sorted((_address(info), f"LSL stream {info.name()} of {info.hostname()}") for info in found)


def _address(info: Any) -> str:
    return SCHEME + quote(info.source_id() or info.name(), safe="")


def _predicate(url: str) -> str:
    """Condition of liblsl for the streams that an address means. Raises SettingsError."""
    parts = urlsplit(url)
    name = unquote(url.removeprefix(SCHEME).split("?")[0])
    kinds = parse_qs(parts.query)
    if set(kinds) - {"type"} or not (name or kinds):
        template = N_("{url} is no stream: give lsl://NAME, its name or source id, or lsl://?type=TYPE")
        raise SettingsError(template, url=url)
    conditions = [f"(name={_quoted(name)} or source_id={_quoted(name)})"] if name else []
    conditions += [f"type={_quoted(kind)}" for kind in kinds.get("type", ())]
    return " and ".join(conditions)


def _quoted(text: str) -> str:
    mark = '"' if "'" in text else "'"
    return f"{mark}{text}{mark}"


def open_inlet(url: str) -> tuple[Any, StreamDescription]:
    """Inlet of the stream at an address, and its description.

    Raises PortUnavailableError if there is none, or several, or it has no numbers; SettingsError.
    """
    pylsl = load_pylsl()
    found = pylsl.resolve_bypred(_predicate(url), minimum=1, timeout=RESOLVE_S)
    if not found:
        raise _no_such_stream(url)
    sources = {(info.source_id() or info.uid()) for info in found}
    if len(sources) > 1:
        template = N_("{url} may be any of {streams}: give the source id of one")
        raise PortUnavailableError(template, url=url, streams=sorted(map(_address, found)))
    if found[0].channel_format() == pylsl.cf_string:
        template = N_("stream {url} sends text: give one of numbers")
        raise PortUnavailableError(template, url=url)
    inlet = pylsl.StreamInlet(found[0], max_buflen=_BUFFER_S, recover=False, as_numpy=True)
    try:
        inlet.open_stream(_OPEN_S)
        full = inlet.info(_OPEN_S)
        inlet.time_correction(_OPEN_S)  # the first takes half a second, later ones nothing
    except pylsl.util.LostError as error:  # found, as its end had not yet been noticed
        raise _no_such_stream(url) from error
    except pylsl.util.TimeoutError as error:
        template = N_("stream {url} does not answer ({fault}): start the program that sends it again")
        raise PortUnavailableError(template, url=url, fault=error) from error
    labels = tuple(full.get_channel_labels() or ())
    description = StreamDescription(
        full.name(), full.type(), full.source_id(), full.hostname(), full.channel_count(),
        full.nominal_srate(), tuple(label or "" for label in labels),
    )  # fmt: skip
    _log.info("opened %s: %s", url, description)
    return inlet, description


def _no_such_stream(url: str) -> PortUnavailableError:
    template = N_("there is no stream {url}: start the program that sends it, in the same network")
    return PortUnavailableError(template, url=url)


class LslLink:
    """An open stream as a link: reads are packed chunks of what came.

    liblsl is told not to find a lost stream again: the application opens it again, and counts what was lost.
    """

    has_baud = False
    is_network = False  # for the probe: a stream has nothing to be asked

    def __init__(self, inlet: Any, description: StreamDescription, url: str) -> None:
        self._inlet = inlet
        self._description = description
        self._waiting = pack_description(description, host_ns())
        self._offset_s = 0.0
        self.url = url

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def read(self) -> bytes:
        """Wait at most 50 ms for the first sample and return all that are there. Raises DeviceLostError."""
        waiting, self._waiting = self._waiting, b""
        if waiting:
            return waiting
        try:
            values, stamps_s = self._inlet.pull_chunk(_READ_TIMEOUT_S, _MAX_SAMPLES, min_samples=1)
        except RuntimeError as error:  # LostError of pylsl
            template = N_("stream {url} has ended: start the program that sends it again")
            raise DeviceLostError(template, url=self.url) from error
        arrival_ns = host_ns()
        if not len(stamps_s):
            return b""
        with contextlib.suppress(RuntimeError):  # the next read finds what is lost
            self._offset_s = self._inlet.time_correction(_READ_TIMEOUT_S)
        return pack_chunk(stamps_s, values.astype(np.float64), self._offset_s, arrival_ns)

    def write(self, data: bytes) -> None:
        """Answer `DESCRIBE` by the next read; a stream takes no other command."""
        if data == DESCRIBE:
            self._waiting = pack_description(self._description, host_ns())

    def configure(self, line_settings: LineSettings) -> None:
        """Do nothing: a stream has no line."""

    def close(self) -> None:
        self._inlet = None  # which disconnects
        _log.info("closed %s", self.url)


class LslOutlet:
    """A stream that this program offers."""

    def __init__(self, name: str, source_id: str, rate_hz: float, channels: int) -> None:
        self._pylsl = load_pylsl()
        info = self._pylsl.StreamInfo(
            name, "Displacement", channels, rate_hz, self._pylsl.cf_double64, source_id
        )
        self._outlet = self._pylsl.StreamOutlet(info)

    @property
    def has_readers(self) -> bool:
        return bool(self._outlet.have_consumers())

    def now_s(self) -> float:
        return float(self._pylsl.local_clock())

    def send(self, stamps_s: Floats, values: Floats) -> None:
        """Send samples: stamps (n,) of `now_s`, values (n, channels)."""
        self._outlet.push_chunk(np.ascontiguousarray(values), stamps_s.tolist())

    def close(self) -> None:
        """Withdraw it, which ends the stream of its readers."""
        self._outlet = None
