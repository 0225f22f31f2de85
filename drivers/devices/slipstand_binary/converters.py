"""Filters of the converters that the reference firmware reads, by the name in its version."""

import re

from drivers.samples import ChannelFilter

_SINC_1, _SINC_3, _SINC_4 = 0.442946, 0.261938, 0.227512
"""Frequency times window at which sinc, sinc^3 and sinc^4 have fallen by 3 dB."""
_HX711_RATE_HZ = 80.0  # it settles in four conversions, 50 ms (Avia, data sheet of the HX711, table 2)
_ADS1256_SETTLING_S = (0.01018, 0.00218, 0.00118, 0.00068, 0.00044, 0.00031)  # as in firmware/ads1256.c
_ADS1256_SWITCHING_S = 0.00018


def converter_filter(firmware: str, rate_hz: float) -> ChannelFilter | None:
    """Filter of both channels at a rate of samples; None for a converter that is not known.

    The ADS1256 averages over its settling time, the longest that fits into half a sample period. The firmware
    stamps a sample with the beginning of that window, which shifts both gauges alike.

    The ADS131M02 converts both inputs at once, each by a sinc^3 of one sample period (oversampling 1024, 512
    and 256 at 1, 2 and 4 kHz; data sheet SBAS853). The firmware stamps a sample with the end of that.
    """
    match = re.search(r"\+(hx711|ads1256|ads131m02)\b", firmware)
    if match is None:
        return None
    if match[1] == "hx711":
        return ChannelFilter(4, _SINC_4 * _HX711_RATE_HZ)
    if match[1] == "ads131m02":
        return ChannelFilter(3, _SINC_3 * rate_hz)
    fitting = [s for s in _ADS1256_SETTLING_S if 2.0 * (s + _ADS1256_SWITCHING_S) * rate_hz <= 1.0]
    return ChannelFilter(1, _SINC_1 / max(fitting)) if fitting else None
