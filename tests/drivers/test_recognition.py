import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from probe_kit import DURATION_S, RATES_HZ, misread, wire_of

from drivers.recognition import recognise

DEVICES = {
    "slipstand-binary": ("slipstand-binary", {}),
    "harp": ("harp", {}),
    "gsv": ("gsv", {}),
    "gsv-int24": ("gsv", {"format": "device"}),
    "gsv-4": ("gsv-234", {}),
    "gsv-3": ("gsv-234", {"format": "gsv-3"}),
    "gsv-2": ("gsv-234", {"format": "gsv-2"}),
    "dataq": ("dataq", {}),
    "hbm-aed": ("hbm-aed", {}),
    "enod4": ("enod4", {}),
    "enod4-data": ("enod4", {"checksum": "data"}),
    "openscale": ("csv", {"format": "openscale"}),
    "csv": ("csv", {"columns": "time_us,table,relative"}),
    "csv-ms": ("csv", {"columns": "time_ms,sequence,table,relative", "separator": "tab"}),
    "csv-european": (
        "csv",
        {"columns": "time_s,table,relative", "separator": "semicolon", "decimal": "comma"},
    ),
    "csv-crc": ("csv", {"columns": "sequence,table,relative,crc"}),
    "csv-xor": ("csv", {"columns": "time_us,table,relative,xor", "separator": "space"}),
    "csv-bare": ("csv", {"columns": "table,relative"}),
    "csv-value": ("csv", {"columns": "time_us,value"}),
}


def heard(name: str) -> tuple[bytes, float]:
    protocol, given = DEVICES[name]
    return wire_of(protocol, given), DURATION_S


@pytest.mark.parametrize("name", DEVICES)
def test_each_device_is_known_by_its_bytes(name):
    protocol, given = DEVICES[name]
    found = recognise(*heard(name))
    assert found is not None
    assert (found.protocol, found.settings) == (protocol, given)
    assert found.share > 0.95
    assert found.rate_hz == pytest.approx(RATES_HZ[protocol], rel=0.01)
    one_gauge = ("openscale", "gsv-3", "gsv-2", "hbm-aed", "enod4", "enod4-data")
    has_one = "value" in given.get("columns", "") or name in one_gauge
    assert found.channels == (1 if has_one else 2)
    assert found.needs_rate == (name in ("csv-bare", "csv-crc", "enod4", "enod4-data"))
    assert bool(found.remark) == (name in ("harp", "gsv-4", "dataq"))


def test_the_time_of_many_lines_a_second_is_known():
    rate_hz = 2000
    lines = (f"{k * 1_000_000 // rate_hz},{9000 + 37 * k % 113},{41 * k % 97}\r\n" for k in range(rate_hz))
    found = recognise("".join(lines).encode(), 1.0)
    assert found is not None
    assert found.settings == {"columns": "time_us,table,relative"}


@pytest.mark.parametrize("name", DEVICES)
def test_what_is_suggested_reads_the_bytes(name):
    from drivers.registry import find_driver

    data, duration_s = heard(name)
    found = recognise(data, duration_s)
    source = find_driver(found.protocol).make_source(found.settings, _given_rate(found))
    samples = sum(len(block) for block in source.decode(data, 0))
    assert samples >= DURATION_S * RATES_HZ[found.protocol] - 11
    assert source.losses.damaged == 0


def _given_rate(found):
    return found.rate_hz if found.needs_rate or found.protocol in ("gsv", "gsv-234", "hbm-aed") else None


@pytest.mark.parametrize("name", DEVICES)
def test_rubbish_before_and_between_hides_none(name):
    data, duration_s = heard(name)
    rubbish = np.random.default_rng(2).integers(0, 256, 200, dtype=np.uint8).tobytes()
    middle = len(data) // 2
    before = b"Booting...\r\n" if DEVICES[name][0] == "csv" else rubbish
    noisy = before + data[:middle] + b"\r\n?!\r\n" + data[middle:]
    found = recognise(noisy, duration_s)
    assert (found.protocol, found.settings) == DEVICES[name]


@pytest.mark.parametrize("name", DEVICES)
@pytest.mark.parametrize("read_baud", [9600, 57600, 230400, 460800])
def test_a_wrong_baud_rate_is_taken_for_nothing(name, read_baud):
    assert recognise(misread(heard(name)[0][:4000], 115200, read_baud), 0.5) is None


def test_the_right_baud_rate_is_read_as_it_was_sent():
    data = heard("csv")[0][:4000]
    assert misread(data, 115200, 115200) == data


@pytest.mark.parametrize("name", ["csv", "openscale", "gsv", "csv-bare"])
@pytest.mark.parametrize("parity", ["E", "O"])
def test_a_wrong_parity_is_taken_for_nothing(name, parity):
    assert recognise(misread(heard(name)[0][:4000], 115200, 115200, parity), 0.5) is None


@given(st.binary(max_size=3000))
@settings(deadline=None)
def test_any_bytes_can_be_looked_at(data):
    recognise(data, 0.5)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\r\n" * 50,
        b"Welcome to the boot loader\r\n" * 20,
        b"24;\r\nhello 5 you\r\n" * 20,
        b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n" * 20,
        b"ST,GS,+0012.340kg\r\n" * 20,
        bytes(2000),
        b"\xaa" * 2000,
        b"\x85\xaa" * 2000,
    ],
)
def test_what_is_none_of_them(data):
    assert recognise(data, 1.0) is None
