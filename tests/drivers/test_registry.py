import subprocess
import sys

import pytest

from drivers.errors import SettingsError
from drivers.registry import DRIVERS, find_driver

NAMES = [
    "slipstand-binary", "csv", "gsv", "gsv-234", "dataq", "modbus",
    "hbm-aed", "enod4", "mantracourt", "scale-line", "harp",
]  # fmt: skip


def test_all_promised_names_are_there_in_order():
    assert [name for name in DRIVERS if name in NAMES] == NAMES


@pytest.mark.parametrize(
    ("name", "baud"),
    [
        ("slipstand-binary", 460800),
        ("csv", 115200),
        ("gsv", 115200),
        ("gsv-234", 115200),
        ("enod4", 115200),
        ("dataq", 115200),
        ("lsl", 0),
        ("modbus", 115200),
        ("hbm-aed", 9600),
        ("harp", 1_000_000),
    ],
)
def test_what_is_built_makes_a_source(name, baud):
    info = find_driver(name)
    assert info.available
    assert info.default_baud == baud
    assert "not verified on hardware" in info.verified
    source = info.make_source({}, 500)
    assert source.identity.protocol == name
    assert source.rate_hz == 500


@pytest.mark.parametrize(
    ("name", "read_by"),
    [("mantracourt", "csv --set format=mantracourt-dscusb"), ("scale-line", "csv --set columns=")],
)
def test_what_is_only_reserved_says_what_reads_it(name, read_by):
    info = DRIVERS[name]
    assert not info.available
    with pytest.raises(
        SettingsError, match=rf"'{name}' .* comes later: its lines are read by --protocol {read_by}"
    ):
        find_driver(name)
    with pytest.raises(SettingsError, match="comes later"):
        info.make_source({}, None)


def test_an_unknown_name_is_answered_with_the_known_ones():
    with pytest.raises(SettingsError, match="'gvs' is not known: use one of slipstand-binary, csv"):
        find_driver("gvs")


def test_listing_protocols_loads_neither_numba_nor_pyserial():
    code = "import sys, drivers.registry; sys.exit('numba' in sys.modules or 'serial' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
