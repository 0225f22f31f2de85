"""Two devices of one channel on two ports, as one `SampleSource`."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Protocol, runtime_checkable

from drivers.envelope import Unwrapper
from drivers.errors import NoDataError, ProtocolError
from drivers.host_time import ActiveTimer
from drivers.pair.channels import GAUGES, PairedChannel, make_paired_channel
from drivers.pair.decoder import PairDecoder, choose_base_gauge
from drivers.registry import ProtocolInfo
from drivers.samples import DeviceIdentity, Losses, SampleBlock
from drivers.skew import Skew
from drivers.source import Link

_RATE = "{}.rate_hz"
_STOOD_S = 0.5
"""A read waits for a fraction of it: whoever comes back later stood still."""
_PAUSE_S = 0.004
"""Bytes of a quick device gather so long in its port: rows wait for those of the other device anyway."""


@runtime_checkable
class PolledSource(Protocol):
    """A source whose device is asked, on a grid of the host's clock."""

    @property
    def rate_hz(self) -> float:
        """How often, in a second."""

    def set_poll_rate(self, rate_hz: float) -> None:
        """Ask so often from now on."""


class PairSource:
    """Rows of both gauges, from reads of two ports in envelopes, as `drivers.pair.link.PairLink` gives them.

    Parameters
    ----------
    protocol : ProtocolInfo
    halves : tuple of Half
        Devices of gauge 1 and gauge 2.
    """

    batch_delay_s = 0.0
    """See `drivers.source.SampleSource`. What comes from the link is there already: it need not gather."""
    channels = 2
    timeout_s = 8.0
    """How long `start` waits for both devices."""

    def __init__(self, protocol: ProtocolInfo, halves: tuple[PairedChannel, PairedChannel]) -> None:
        self.channel_sources = halves
        for half in halves:
            half.source.batch_delay_s = _PAUSE_S
        self._protocol = protocol
        self._decoder: PairDecoder | None = None

    @property
    def identity(self) -> DeviceIdentity:
        """What both devices said of themselves, and their rates once these are known."""
        both = [half.source.identity for half in self.channel_sources]
        settings: dict[str, str] = {}
        for gauge, one, rate_hz in zip(GAUGES, both, self._rates_hz or (None, None), strict=True):
            settings |= {f"{gauge}.{key}": value for key, value in one.settings.items()}
            if rate_hz is not None:
                settings[_RATE.format(gauge)] = repr(rate_hz)
        return DeviceIdentity(
            self._protocol.name,
            f"{_joined(one.name for one in both)}, one for each gauge",
            _joined(one.firmware for one in both),
            _joined(one.serial_number for one in both),
            settings,
        )

    @property
    def rate_hz(self) -> float:
        """Nominal rows a second, of one device's rate. Raises ProtocolError while that is not known."""
        rates_hz = tuple(half.source.rate_hz for half in self.channel_sources)
        return rates_hz[choose_base_gauge((rates_hz[0], rates_hz[1]))]

    @property
    def losses(self) -> Losses:
        """The account until now."""
        return self._decoder.losses if self._decoder else Losses()

    @property
    def run_note(self) -> str:
        """What the devices have to say, each sentence once."""
        return "; ".join(dict.fromkeys(filter(None, (half.source.run_note for half in self.channel_sources))))

    def skew(self, first_index: int, end_index: int) -> Skew | None:
        """By how much later gauge 2 was read than gauge 1 in these rows; None where it never was."""
        return self._decoder.skew(first_index, end_index) if self._decoder else None

    def take_warnings(self) -> list[str]:
        """What became of one device alone since the last call, in sentences, and what each has to say."""
        own = [note for half in self.channel_sources for note in half.source.take_warnings()]
        return own + (self._decoder.take_warnings() if self._decoder else [])

    def prepare(self) -> None:
        """Compile what decoding needs."""
        for half in self.channel_sources:
            half.source.prepare()

    def start(self, link: Link) -> bytes:
        """Wait until both devices have sent something, which the link has asked them to.

        Raises
        ------
        NoDataError
            If one of them says nothing.
        DriverError
            As its own source raises it.
        """
        received, unwrapper = b"", Unwrapper()
        silent = set(range(len(self.channel_sources)))
        waited = ActiveTimer(_STOOD_S)
        while silent and waited.elapsed_s() < self.timeout_s:
            data = link.read()
            received += data
            silent -= {read.port for read in unwrapper.feed(data) if read.data}
        if silent:
            raise NoDataError(
                f"gauge {min(silent) + 1}: nothing came in {self.timeout_s:g} s, check its device and cable"
            )
        if self._decoder is None:
            self._synchronise_polling()
        return received

    def resume(self, link: Link) -> bytes:
        """Go on with devices that were lost and found again; see `start`."""
        return self.start(link)

    def read(self, link: Link) -> bytes:
        """What came from either port."""
        return link.read()

    def stop(self, link: Link) -> None:
        """The link stops both devices when it is closed."""

    def decode(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:  # noqa: ARG002 - envelopes tell it
        """Rows completed by `data`, b"" where both links were broken; exhaust it.

        Raises
        ------
        ProtocolError
            If the rates are not known, since neither was the source started nor were they given.
        """
        if self._decoder is None:
            rates_hz = self._rates_hz
            if rates_hz is None:
                raise ProtocolError(
                    f"{self._protocol.name}: the rates of two devices are not known: start them"
                )
            self._decoder = PairDecoder(self.channel_sources, rates_hz)
        if data:
            yield from self._decoder.feed(data)
        else:
            self._decoder.expect_restart()

    def _synchronise_polling(self) -> None:
        """Ask devices that must be asked at the same moments, so that nothing lies between their readings."""
        asked = [half.source for half in self.channel_sources if isinstance(half.source, PolledSource)]
        if len(asked) == len(self.channel_sources):
            rate_hz = min(source.rate_hz for source in asked)
            for source in asked:
                source.set_poll_rate(rate_hz)

    @property
    def _rates_hz(self) -> tuple[float, float] | None:
        try:
            return self.channel_sources[0].source.rate_hz, self.channel_sources[1].source.rate_hz
        except ProtocolError:
            return None


def make_pair(
    protocol: ProtocolInfo,
    settings: dict[str, str],
    rate_hz: float | None,
    recorded_settings: Mapping[str, str] | None = None,
) -> PairSource:
    """Source of two devices.

    Parameters
    ----------
    protocol : ProtocolInfo
        Both devices speak it.
    settings : dict
        Of both; those whose names begin with `relative.` are of gauge 2's alone.
    rate_hz : float or None
        Samples a second to ask of both.
    facts : mapping, optional
        `identity.settings` of an earlier recording, to decode it again: they tell its rates.

    Raises
    ------
    SettingsError
        For a protocol that has both gauges on one port, or a setting or rate that cannot be.
    """
    rates = [(recorded_settings or {}).get(_RATE.format(gauge)) for gauge in GAUGES]
    own = {} if rates[1] is None else {"relative.rate": rates[1]}
    return PairSource(
        protocol,
        (
            make_paired_channel(protocol, 0, settings, rate_hz if rates[0] is None else float(rates[0])),
            make_paired_channel(protocol, 1, settings | own, rate_hz),
        ),
    )


def _joined(words: Iterable[str]) -> str:
    return " and ".join(dict.fromkeys(filter(None, words)))
