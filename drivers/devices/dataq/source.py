"""A DATAQ instrument as a `SampleSource`."""

from typing import Literal

import msgspec
import numpy as np

from drivers.devices.dataq import DRIVER, codec, commands
from drivers.devices.dataq.codec import ScanDecoder, ScanLayout
from drivers.devices.dataq.commands import MODELS, Divisors, Model
from drivers.errors import ProtocolError
from drivers.polling import drain
from drivers.recognition import IdentityQuery, Recognition, rate_from_count, unless_coincidence
from drivers.samples import ChannelFilter, DeviceIdentity
from drivers.source import LineSettings, Link
from drivers.stream import SampleSource, check_gauge_channels, check_rate, parse_settings
from messages.i18n import N_
from messages.message import Message, message

RATE_HZ = 2000.0
"""Unless another is asked for; the analysis of the paper's motions needs no more."""
_TRIES = 2
_CORNER_OF_MEAN = 0.443
"""Corner of a mean by its rate: where sin(pi x) / (pi x) is 1 / sqrt 2."""
_FILTERS = {"last": 0, "average": 1}  # argument of `filter` (page 51)
_MIN_LAYOUT_BYTES = 120
"""Bytes that show the layout of a stream without a header."""


class DataqSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give. Raises SettingsError."""

    table: int = 0
    relative: int = 1
    """Analog channels that the two gauges are wired to, from 0."""
    range_v: float = 10.0
    """Full scale of both channels (V), where the model has several."""
    filter: Literal["last", "average"] = "last"
    """`average` lets the instrument average what its converter reads between two samples."""
    model: Literal["auto", "1100", "1110", "1120", "2108", "4108", "4208"] = "auto"
    """What is connected; `auto` asks it."""

    def __post_init__(self) -> None:
        check_gauge_channels(self.table, self.relative, range(8))


class DataqSource(SampleSource):
    """Conversation: stop, identify, set scan list, rate and filter, start.

    The instrument stops where its buffer overflows, and is then started again.
    """

    stop_command = commands.STOP

    def __init__(self, settings: DataqSettings, rate_hz: float = RATE_HZ) -> None:
        super().__init__(DeviceIdentity(DRIVER.name, "DATAQ"), DRIVER.default_baud, rate_hz)
        self._settings = settings
        self._model: Model | None = None
        self._divisors = Divisors(1)
        self._tail = b""

    @property
    def filters(self) -> tuple[ChannelFilter | None, ChannelFilter | None]:
        """Mean of the models without a CIC filter, of whose order nothing is published."""
        is_mean = self._model is not None and self._divisors.deca > 1 and not self._model.has_dec
        own = ChannelFilter(1, _CORNER_OF_MEAN * self.rate_hz)
        return (own, own) if is_mean and self._settings.filter == "average" else (None, None)

    def prepare(self) -> None:
        scans = codec.encode_scans(codec.WITH_DIGITAL, np.zeros((5, 2)))
        list(ScanDecoder(codec.WITH_DIGITAL, 1.0).feed(scans.tobytes(), 0))

    def start(self, link: Link) -> bytes:
        self.prepare()
        received = self.silence(link)
        model = self._identify(link, received)
        self._set_up(link, model)
        drain(link)
        link.write(commands.START)
        header, layout = codec.header(model.name), codec.layout_of(model.name)
        first = self.await_stream(link, lambda data: _has_scans(header + data, layout), self.timeout_s)
        self._tail = first[-len(commands.OVERFLOW) :]
        return header + first

    def read(self, link: Link) -> bytes:
        data = super().read(link)
        self._tail = (self._tail + data)[-len(commands.OVERFLOW) :]
        if self._tail != commands.OVERFLOW or self._model is None:
            return data
        self._tail = b""
        link.write(commands.START)
        return data + codec.header(self._model.name)

    def make_decoder(self, data: bytes) -> ScanDecoder | None:
        layout = codec.layout_in_header(data)
        if layout is None and self._settings.model != "auto":
            layout = codec.layout_of(self._settings.model)
        if layout is None and len(data) >= _MIN_LAYOUT_BYTES:
            layout = codec.find_layout(data)
        return ScanDecoder(layout, self.rate_hz) if layout else None

    def _identify(self, link: Link, received: bytes) -> Model:
        name = self._ask(link, "info 1", _TRIES)
        if not name:  # or only its echo
            raise self.no_answer_error(received, sends=codec.find_layout(received) is not None)
        model = MODELS.get(name)
        if model is None or self._settings.model not in ("auto", name):
            wanted = [self._settings.model] if self._settings.model != "auto" else list(MODELS)
            template = N_("the instrument is DI-{name}, and {wanted} can be read: choose its port")
            raise ProtocolError(template, name=name, wanted=wanted)
        version = commands.firmware_version(self._ask(link, "info 2") or "")
        serial_number = self._ask(link, "info 6") or ""
        self._model = model
        self._identity = DeviceIdentity(DRIVER.name, f"DATAQ DI-{name}", version, serial_number)
        return model

    def _set_up(self, link: Link, model: Model) -> None:
        settings = self._settings
        channels = (settings.table, settings.relative)
        words = [model.scan_word(channel, settings.range_v) for channel in channels]
        words += [commands.DIGITAL_INPUTS] * model.has_digital_word
        dividend = self._ask(link, "info 9") or ""
        dividend_hz = float(dividend) if dividend.isdecimal() else commands.DIVIDEND_HZ
        averages = settings.filter == "average"
        self._divisors = commands.divisors_for(
            model, self.rate_hz, averages=averages, dividend_hz=dividend_hz
        )
        self._rate_hz = self._divisors.rate_hz(dividend_hz)
        sent_bytes_per_s = self.rate_hz * codec.layout_of(model.name).length
        self._require(link, "encode 0")
        self._require(link, f"ps {commands.packet_size(sent_bytes_per_s)}")
        for place, word in enumerate(words):
            self._require(link, f"slist {place} {word}")
        for channel in channels:
            self._require(link, f"filter {channel} {_FILTERS[settings.filter]}")
        self._require(link, f"srate {self._divisors.srate}")
        if model.has_dec:
            self._require(link, f"dec {self._divisors.dec}")
        self._require(link, f"deca {self._divisors.deca}")

    def _ask(self, link: Link, command: str, tries: int = 1) -> str | None:
        sent = command.encode("ascii") + commands.END
        return self.request(link, sent, lambda data: commands.find_reply(data, command), tries)

    def _require(self, link: Link, command: str) -> None:
        if self._ask(link, command) is None:
            template = N_("the instrument does not take {command}: update its firmware, then try again")
            raise ProtocolError(template, command=command)


def _has_scans(data: bytes, layout: ScanLayout) -> bool:
    return any(map(len, ScanDecoder(layout, 1.0).feed(data, 0)))


def make_source(settings: dict[str, str], rate_hz: float | None) -> DataqSource:
    """Source of the device. Raises SettingsError for a setting or rate that cannot be."""
    check_rate(rate_hz)
    return DataqSource(parse_settings(DataqSettings, settings, DRIVER.name), rate_hz or RATE_HZ)


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:
    """What `data` are; see `drivers.recognition.recognise`."""
    layout = codec.find_layout(data)
    if layout is None:
        return None
    scans = sum(map(len, ScanDecoder(layout, 1.0).feed(data, 0)))
    share = min(1.0, scans * layout.length / max(len(data), 1))
    remark = message("it still scans for another program: close that program first")
    rate_hz = rate_from_count(scans, duration_s)
    found = Recognition(DRIVER.name, share, scans, rate_hz=rate_hz, remark=remark)
    return unless_coincidence(found, has_checksum=False)


def _parse_model(received: bytes) -> Message | None:
    name = commands.find_reply(received, "info 1")
    if name is None:
        return None
    return (
        message("DI-{model}", model=name)
        if name in MODELS
        else message("DI-{model}, which is not read", model=name)
    )


IDENTITY_QUERY = IdentityQuery(4, b"\rinfo 1\r", (LineSettings(DRIVER.default_baud),), _parse_model)
