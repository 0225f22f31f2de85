"""Commands of DATAQ instruments and their replies, ASCII that ends in CR.

Source of all: DATAQ Instruments, "Data Acquisition Instrument Command Protocol", 1 August 2019; pages below.
"""

import math
import re
from dataclasses import dataclass

from drivers.errors import ProtocolError, SettingsError
from messages.i18n import N_

END = b"\r"
STOP = b"stop\r"
START = b"start 0\r"
OVERFLOW = b"stop 01"
"""Last bytes of a stream whose instrument had no room left for readings (page 50)."""
BUFFER_BYTES = 2048  # 1024 readings (page 50)
DIVIDEND_HZ = 60_000_000
"""The rate is this by srate, dec and deca (page 48)."""
MAX_SRATE = 65_535
MAX_DEC = 512
MAX_DECA = 40_000
DIGITAL_INPUTS = 8  # scan list word of the digital inputs (pages 41 to 46)
PACKET_BYTES = 16  # of `ps 0`; each step doubles it (page 20)
MAX_PACKET = 7  # its highest argument
_PACKET_S = 0.005  # a packet is sent when it is full: it is to delay readings by no more


@dataclass(frozen=True, slots=True)
class Model:
    """Properties of an instrument (pages 40 to 48 and 61 to 68)."""

    name: str
    bits: int
    """Of its converter; readings are left-justified in 16."""
    channels: int
    ranges_v: tuple[float, ...] = (10.0,)
    """Full scales, in the order of their codes in the scan list."""
    lowest_srate: int = 375
    has_dec: bool = True
    has_digital_word: bool = True
    """Whether the digital inputs are a word of the scan list, or the low bits of its first reading."""

    def scan_word(self, channel: int, range_v: float) -> int:
        """Word of the scan list for an analog channel. Raises ProtocolError for one that is not there."""
        if not channel < self.channels:
            template = N_(
                "DI-{model} has channels 0 to {last}, and a gauge is to be on {channel}: choose one of these"
            )
            raise ProtocolError(template, model=self.name, last=self.channels - 1, channel=channel)
        if range_v not in self.ranges_v:
            template = N_("DI-{model} has no range of {range_v:g} V: set range_v to one of {ranges}")
            ranges = [f"{one:g}" for one in self.ranges_v]
            raise ProtocolError(template, model=self.name, range_v=range_v, ranges=ranges)
        return self.ranges_v.index(range_v) << 8 | channel


_WIDE_V = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0)
_MODELS = (
    Model("1100", 12, 4, lowest_srate=2000, has_dec=False, has_digital_word=False),  # with two channels
    Model("1110", 12, 8, has_dec=False),
    Model("1120", 14, 4, _WIDE_V),
    Model("2108", 16, 8),
    Model("4108", 16, 8, (10.0, 5.0, 2.0, 1.0, 0.5, 0.2)),
    Model("4208", 16, 8, _WIDE_V),
)
MODELS = {model.name: model for model in _MODELS}


@dataclass(frozen=True, slots=True)
class Divisors:
    """What makes the rate."""

    srate: int
    dec: int = 1
    deca: int = 1

    def rate_hz(self, dividend_hz: float = DIVIDEND_HZ) -> float:
        return dividend_hz / (self.srate * self.dec * self.deca)


def divisors_for(model: Model, rate_hz: float, *, averages: bool, dividend_hz: float) -> Divisors:
    """Divisors of the rate that is nearest; most readings for one where they are averaged, else fewest.

    Raises SettingsError for a rate that the model cannot have.
    """
    ticks = dividend_hz / rate_hz
    if round(ticks) < model.lowest_srate:
        template = N_("rate {rate_hz:g} Hz is too high for DI-{model}: give {highest_hz:g} at most")
        highest_hz = dividend_hz / model.lowest_srate
        raise SettingsError(template, rate_hz=rate_hz, model=model.name, highest_hz=highest_hz)
    of_one = math.floor(ticks / model.lowest_srate) if averages else math.ceil(ticks / MAX_SRATE)
    dec = min(of_one, MAX_DEC) if model.has_dec else 1
    deca = of_one // dec if averages else math.ceil(of_one / dec)
    srate = round(ticks / (dec * deca))
    if deca > MAX_DECA or srate > MAX_SRATE:
        template = N_("rate {rate_hz:g} Hz is too low for DI-{model}: give a higher one")
        raise SettingsError(template, rate_hz=rate_hz, model=model.name)
    return Divisors(srate, dec, deca)


def packet_size(bytes_per_s: float) -> int:
    """Argument of `ps` for a stream: packets of 16 to 2048 bytes that are full after 5 ms, if possible."""
    packets = max(1.0, bytes_per_s * _PACKET_S / PACKET_BYTES)
    return min(MAX_PACKET, math.floor(math.log2(packets)))


def find_reply(received: bytes, command: str) -> str | None:
    """What follows the echo of `command` in `received`, maybe nothing; None while there is no echo."""
    echo = re.search(re.escape(command.encode("ascii")) + rb"(?: +([^\r\0]*))?\0*\r", received)
    return None if echo is None else (echo[1] or b"").strip().decode("ascii", "replace")


def firmware_version(reply: str) -> str:
    """Version in the reply to `info 2`, hundredths in hexadecimal (page 20); as it came if it is none."""
    return f"{int(reply, 16) / 100:.2f}" if re.fullmatch("[0-9A-Fa-f]{1,4}", reply) else reply
