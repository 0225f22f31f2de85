"""`slipstand device list`: protocols, and the devices that are chosen by settings of them."""

from typing import Any

from drivers.driver import UNVERIFIED
from drivers.registry import AVAILABLE, DRIVERS


def test_each_device_has_a_row_with_what_it_was_verified_against(slipstand: Any) -> None:
    rows = slipstand("device", "list", "--json").json
    protocols = [row for row in rows if not row["settings"]]
    assert [row["protocol"] for row in protocols] == list(DRIVERS)
    assert [row["available"] for row in protocols] == [driver.available for driver in DRIVERS.values()]
    named = {row["name"]: row for row in rows}
    assert len(named) == len(rows)
    for row in rows:
        if row["available"]:
            assert row["verified"].removeprefix(UNVERIFIED).strip("; "), row["name"]
    iload = named["loadstar-iload"]
    assert (iload["protocol"], iload["settings"]) == ("csv", {"format": "loadstar-iload"})
    assert (iload["title"], iload["default_baud"]) == ("Loadstar iLoad", 9600)
    assert "loadstarsensors.com" in iload["verified"]
    flintec = named["flintec-dad141"]
    assert (flintec["protocol"], flintec["settings"]) == ("modbus", {"map": "flintec-dad141"})
    assert "pymodbus" in flintec["verified"]
    assert "Flintec DAD 141.1 Technical Manual" in flintec["verified"]


def test_the_table_says_how_a_device_is_chosen(slipstand: Any) -> None:
    lines = slipstand("device", "list").out.splitlines()
    (iload,) = [line for line in lines if "Loadstar iLoad" in line]
    assert iload.startswith("csv --set format=loadstar-iload  ")
    (csv,) = [line for line in lines if line.startswith("csv  ")]
    assert lines.index(csv) < lines.index(iload)


def test_what_a_row_says_makes_a_device() -> None:
    for driver in AVAILABLE:
        for variant in driver.list_variants():
            settings = driver.single_gauge_settings("table", variant.settings)[0]
            source = driver.make_source(settings, 100.0)
            assert source.identity.protocol == driver.name
            assert driver.make_simulated(settings)
