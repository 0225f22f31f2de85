"""An LSL stream as a `SampleSource`."""

import math

import msgspec
import numpy as np

from drivers.devices.lsl import DRIVER
from drivers.devices.lsl.codec import StreamDecoder
from drivers.envelope import Unwrapper
from drivers.errors import ProtocolError, SettingsError
from drivers.recognition import Recognition, which_channels
from drivers.samples import DeviceIdentity
from drivers.source import Link
from drivers.stream import SampleSource, check_gauge_channels, check_rate, parse_settings
from drivers.stream_packets import DESCRIBE, StreamDescription, find_description, pack_chunk, unpack_chunk
from messages.i18n import N_
from messages.message import Message, message, option

_MAX_CHANNELS = 500


class LslSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What `--set` and `[device.settings]` may give. Raises SettingsError."""

    table: int = 0
    relative: int = 1
    """Channels of the stream that the two gauges are, from 0."""
    overload: float = math.inf
    """Readings of this size and more are marked as overloaded."""

    def __post_init__(self) -> None:
        check_gauge_channels(self.table, self.relative, range(_MAX_CHANNELS))
        if not self.overload > 0:
            raise SettingsError("overload {value:g} must be positive: give a larger one", value=self.overload)


class LslSource(SampleSource):
    """Conversation: ask the stream for its description, and wait for samples. Nothing else can be asked."""

    def __init__(self, settings: LslSettings, rate_hz: float | None = None) -> None:
        super().__init__(DeviceIdentity(DRIVER.name, "LSL stream"), DRIVER.default_baud, rate_hz)
        self._settings = settings

    def prepare(self) -> None:
        data = pack_chunk(np.arange(2.0), np.zeros((2, 2)), 0.0, 0)
        list(StreamDecoder(0, 1, 1.0).feed(data, 0))

    def start(self, link: Link) -> bytes:
        self.prepare()
        link.write(DESCRIBE)
        received = self.await_stream(link, _has_samples, self.timeout_s)
        description = _find_description(received)
        if description is None:
            raise self.no_data_error(received)
        self._identity = DeviceIdentity(
            DRIVER.name,
            description.name,
            serial_number=description.source_id,
            settings={"host": description.host, "type": description.kind},
        )
        self._check_channels(description)
        self._set_rate(description.rate_hz)
        return received

    def make_decoder(self, data: bytes) -> StreamDecoder | None:
        if self._rate_hz is None:
            description = _find_description(data)
            if description is None or not description.rate_hz > 0:
                return None
            self._rate_hz = description.rate_hz
        settings = self._settings
        return StreamDecoder(settings.table, settings.relative, self._rate_hz, settings.overload)

    def _check_channels(self, description: StreamDescription) -> None:
        last = description.channels - 1
        for name, channel in (("table", self._settings.table), ("relative", self._settings.relative)):
            if channel > last:
                template = N_(
                    "stream {stream} has channels 0 to {last}, and the {name} gauge is to be on {channel}: "
                    "set {name} to its channel, or let the feeder send that one too"
                )
                raise ProtocolError(template, stream=description.name, last=last, name=name, channel=channel)

    def _set_rate(self, nominal_hz: float) -> None:
        if not nominal_hz > 0:
            if self._rate_hz is None:
                raise ProtocolError("the stream does not tell its rate: give it with --rate")
            return
        if not self.is_same_rate(nominal_hz):
            template = N_(
                "the stream has {actual_hz:g} Hz where {rate_hz:g} Hz is expected: "
                "ask for --rate {actual_hz:g}"
            )
            raise ProtocolError(template, actual_hz=nominal_hz, rate_hz=self._rate_hz)
        self._rate_hz = nominal_hz


def _find_description(data: bytes) -> StreamDescription | None:
    return find_description(Unwrapper().feed(data))


def _count_samples(data: bytes) -> int:
    chunks = (unpack_chunk(read) for read in Unwrapper().feed(data))
    return sum(len(chunk[0]) for chunk in chunks if chunk is not None)


def _has_samples(data: bytes) -> bool:
    return _count_samples(data) > 0 and _find_description(data) is not None


def make_source(settings: dict[str, str], rate_hz: float | None) -> LslSource:
    """Source of the stream. Raises SettingsError for a setting or rate that cannot be."""
    check_rate(rate_hz)
    return LslSource(parse_settings(LslSettings, settings, DRIVER.name), rate_hz)


def recognise(data: bytes, duration_s: float | None) -> Recognition | None:  # noqa: ARG001 - it tells its rate
    """What `data` are; see `drivers.recognition.recognise`."""
    description = _find_description(data)
    samples = _count_samples(data)
    if description is None or not samples:
        return None
    rate_hz = description.rate_hz or None
    gauges = min(description.channels, DRIVER.channels)
    return Recognition(
        DRIVER.name, 1.0, samples, gauges, rate_hz=rate_hz, needs_rate=rate_hz is None,
        remark=_channels_remark(description),
    )  # fmt: skip


def _channels_remark(description: StreamDescription) -> Message:
    if not description.labels:
        return which_channels(description.channels)
    labels = ", ".join(f"{k} {label}" for k, label in enumerate(description.labels))
    template = N_("of its channels ({labels}) say which the gauges are: {option} table=N {option} relative=N")
    return message(template, labels=labels, option=option("--set"))
