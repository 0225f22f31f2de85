"""Two devices of one gauge on two ports, as one `SampleSource`."""

from collections.abc import Iterable, Mapping

from drivers.driver import GAUGES, DeviceDriver
from drivers.envelope import Unwrapper
from drivers.errors import NoDataError, ProtocolError, SettingsError
from drivers.host_time import ActiveTimer
from drivers.pair.decoder import PairDecoder, PairedChannel, choose_base_gauge
from drivers.samples import ChannelFilter, DeviceIdentity
from drivers.source import Link
from drivers.stream import SampleSource
from messages.i18n import N_
from messages.message import Message, joined

_OWN_PREFIX = "relative."  # prefix of settings of gauge 2's device alone
_OWN_RATE = "relative.rate"
_RATE_KEY = "{}.rate_hz"
_STALL_S = 0.5
"""A read waits for 50 ms: after more, this computer stood still."""
_BATCH_DELAY_S = 0.004  # how long bytes collect in each port: rows wait for the other device anyway


class PairSource(SampleSource):
    """Rows of both gauges, from enveloped reads of two ports (`drivers.pair.link.PairLink`).

    The threads of the ports collect bytes, not this source. The link starts and stops the devices.
    """

    timeout_s = 8.0

    def __init__(self, driver: DeviceDriver, channel_sources: tuple[PairedChannel, PairedChannel]) -> None:
        super().__init__(DeviceIdentity(driver.name, driver.title), 0, None)
        self.channel_sources = channel_sources
        for channel in channel_sources:
            channel.source.batch_delay_s = _BATCH_DELAY_S

    @property
    def identity(self) -> DeviceIdentity:
        both = [channel.source.identity for channel in self.channel_sources]
        settings: dict[str, str] = {}
        for gauge, one, rate_hz in zip(GAUGES, both, self._rates_hz or (None, None), strict=True):
            settings |= {f"{gauge}.{key}": value for key, value in one.settings.items()}
            if rate_hz is not None:
                settings[_RATE_KEY.format(gauge)] = repr(rate_hz)
        return DeviceIdentity(
            self._identity.protocol,
            f"{_distinct(one.name for one in both)}, one for each gauge",
            _distinct(one.firmware for one in both),
            _distinct(one.serial_number for one in both),
            settings,
        )

    @property
    def rate_hz(self) -> float:
        first, second = (channel.source.rate_hz for channel in self.channel_sources)
        return (first, second)[choose_base_gauge((first, second))]

    @property
    def filters(self) -> tuple[ChannelFilter | None, ChannelFilter | None]:
        first, second = (channel.source.filters[channel.column] for channel in self.channel_sources)
        return first, second

    @property
    def run_note(self) -> Message:
        notes = [channel.source.run_note for channel in self.channel_sources]
        return joined(list({str(note): note for note in notes if note}.values()), "; ")

    def take_warnings(self) -> list[Message]:
        own = [warning for channel in self.channel_sources for warning in channel.source.take_warnings()]
        return own + super().take_warnings()

    def prepare(self) -> None:
        for channel in self.channel_sources:
            channel.source.prepare()

    def start(self, link: Link) -> bytes:
        """Wait until both devices have sent something; the link starts them. Raises NoDataError."""
        received, unwrapper = b"", Unwrapper()
        silent = set(range(len(self.channel_sources)))
        waited = ActiveTimer(_STALL_S)
        while silent and waited.elapsed_s() < self.timeout_s:
            data = link.read()
            received += data
            silent -= {read.port for read in unwrapper.feed(data) if read.data}
        if silent:
            template = N_("gauge {gauge}: nothing came in {timeout_s:g} s, check its device and cable")
            raise NoDataError(template, gauge=min(silent) + 1, timeout_s=self.timeout_s)
        sources = [channel.source for channel in self.channel_sources]
        if self._decoder is None and all(source.is_polled for source in sources):
            # Both are polled at the same times, so that their readings belong together.
            rate_hz = min(source.rate_hz for source in sources)
            for source in sources:
                source.set_poll_rate(rate_hz)
        return received

    def read(self, link: Link) -> bytes:
        return link.read()

    def make_decoder(self, data: bytes) -> PairDecoder:  # noqa: ARG002 - the rates are enough
        rates_hz = self._rates_hz
        if rates_hz is None:
            template = N_("{protocol}: the rates of two devices are not known: start them")
            raise ProtocolError(template, protocol=self._identity.protocol)
        return PairDecoder(self.channel_sources, rates_hz)

    @property
    def _rates_hz(self) -> tuple[float, float] | None:
        try:
            first, second = (channel.source.rate_hz for channel in self.channel_sources)
        except ProtocolError:
            return None
        return first, second


def make_pair(
    driver: DeviceDriver,
    settings: Mapping[str, str],
    rate_hz: float | None,
    recorded_settings: Mapping[str, str] | None = None,
) -> PairSource:
    """Source of two devices of one driver.

    Settings with the prefix `relative.` are of gauge 2's device alone, `relative.rate` its rate; `rate_hz` is
    asked of both. `recorded_settings` are `identity.settings` of an earlier recording, whose rates decode it
    again. Raises SettingsError for a device that has both gauges on one port, or a setting or rate that
    cannot be.
    """
    recorded = recorded_settings or {}
    common = {key: value for key, value in settings.items() if not key.startswith(_OWN_PREFIX)}
    own = {key.removeprefix(_OWN_PREFIX): settings[key] for key in settings.keys() - common.keys()}
    rate_key = _OWN_RATE.removeprefix(_OWN_PREFIX)
    own_rate_hz = _parse_rate(own.pop(rate_key)) if rate_key in own else rate_hz
    channels = []
    for gauge, given, asked_hz in zip(GAUGES, (common, common | own), (rate_hz, own_rate_hz), strict=True):
        recorded_hz = recorded.get(_RATE_KEY.format(gauge))
        complete, column = driver.single_gauge_settings(gauge, given)
        source = driver.make_source(complete, asked_hz if recorded_hz is None else _parse_rate(recorded_hz))
        channels.append(PairedChannel(source, column))
    return PairSource(driver, (channels[0], channels[1]))


def _parse_rate(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        template = N_("{key} {text!r} is no number: give samples a second")
        raise SettingsError(template, key=_OWN_RATE, text=text) from None


def _distinct(words: Iterable[str]) -> str:
    return " and ".join(dict.fromkeys(filter(None, words)))
