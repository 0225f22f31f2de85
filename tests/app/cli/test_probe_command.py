"""`slipstand device probe`: what was found, in words, as JSON, and the command that records from it."""

import shlex
from collections.abc import Callable
from typing import Any

import pytest

from app.cli import device
from drivers.host_checks import PortHint
from drivers.port import PortInfo, PortUser
from drivers.port_probe import LineSettings, PortReport, ProbeOutcome
from drivers.recognition import Recognition
from drivers.registry import find_driver
from tools import page_commands

ARDUINO = PortInfo("/dev/ttyACM0", "n/a", 0x2341, 0x43, "75")
COLUMNS = {"columns": "table,relative", "separator": "semicolon"}
LINES = Recognition("csv", 0.99, 300, settings=COLUMNS, rate_hz=80.4, needs_rate=True)
SCALE = Recognition("csv", 1.0, 30, channels=1, settings={"format": "openscale"}, rate_hz=10.0)
HINT = PortHint("it is held back", "Ask for less", rule_helps=True)

FOUND = PortReport(
    ARDUINO, "Arduino Uno", ProbeOutcome.RECOGNISED, recognition=LINES, line_settings=LineSettings(57600, "E")
)
HELD = PortReport(
    ARDUINO, "Arduino Uno", ProbeOutcome.IN_USE, "in use by x", (PortUser(7, "x"),), hints=(HINT,)
)


@pytest.fixture
def probe(slipstand: Any, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Run the command with one port that is found to be so."""

    def run(found: PortReport, *arguments: str, of: PortInfo = ARDUINO) -> Any:
        asked: list[tuple[str, bool]] = []

        def look(port: PortInfo, write: bool, tell: Callable[[str], None]) -> PortReport:
            asked.append((port.device, write))
            tell("listening")
            return found

        monkeypatch.setattr(device, "probe_port", look)
        monkeypatch.setattr(device, "present_ports", lambda: [of])
        monkeypatch.setattr(device, "list_streams", list)
        outcome = slipstand("device", "probe", *arguments)
        assert outcome.err == f"{asked[0][0]}: listening\n"
        return outcome, asked

    return run


def test_what_speaks_is_said_with_the_command_that_records_from_it(probe: Callable[..., Any]) -> None:
    outcome, asked = probe(FOUND)
    assert asked == [("/dev/ttyACM0", False)]
    first, speaks, record = outcome.out.splitlines()
    assert first == "/dev/ttyACM0 Arduino Uno, USB 2341:0043 75"
    assert speaks.startswith("  speaks csv at 57600 baud 8E1: CSV lines")
    assert speaks.endswith(f"; 2 gauges, 80.4 Hz; {find_driver('csv').verified}")
    assert shlex.split(record.removeprefix("  record with: ")) == [
        "slipstand", "record", "--port", "/dev/ttyACM0", "--protocol", "csv",
        "--baud", "57600", "--parity", "E",
        "--set", "columns=table,relative", "--set", "separator=semicolon", "--rate", "80.4",
    ]  # fmt: skip


def test_the_page_shows_what_is_printed(probe: Callable[..., Any]) -> None:
    adapter = PortInfo("/dev/ttyUSB0", "n/a", 0x0403, 0x6001, "A50285BI")
    columns = {"columns": "time_us,table,relative"}
    lines = Recognition("csv", 0.99, 300, settings=columns, rate_hz=500.0)
    outcome, _ = probe(
        PortReport(adapter, "FTDI FT232R adapter", ProbeOutcome.RECOGNISED, recognition=lines), of=adapter
    )
    shown = page_commands.shown_lines("slipstand device probe")
    assert page_commands.faults(shown, outcome.out.splitlines()) == [], outcome.out


def test_a_rate_in_thousands_is_written_out(probe: Callable[..., Any]) -> None:
    lines = Recognition("csv", 0.99, 300, settings=COLUMNS, rate_hz=2004.2, needs_rate=True)
    outcome, _ = probe(PortReport(ARDUINO, "Arduino Uno", ProbeOutcome.RECOGNISED, recognition=lines))
    assert outcome.out.rstrip().endswith("--rate 2000")


def test_the_usual_baud_rate_need_not_be_given_and_one_gauge_wants_another_port(
    probe: Callable[..., Any],
) -> None:
    found = PortReport(
        PortInfo("COM3"), "", ProbeOutcome.RECOGNISED, recognition=SCALE, line_settings=LineSettings(9600)
    )
    outcome, asked = probe(found, "COM3", "--write")
    assert asked == [("COM3", True)]
    assert outcome.out.splitlines()[-1] == (
        "  record with: slipstand record --port COM3 --protocol csv --set format=openscale "
        "--relative-port PORT-OF-GAUGE-2"
    )
    assert "1 gauge, 10 Hz" in outcome.out


def test_what_stands_in_the_way_is_said_with_its_remedy(probe: Callable[..., Any]) -> None:
    outcome, _ = probe(HELD)
    _, message, hint, remedy, rule = outcome.out.splitlines()
    assert message == "  in use by x"
    assert (hint, remedy) == ("  it is held back", "    Ask for less")
    assert rule.startswith("    for good: sudo cp ")


def test_as_json(probe: Callable[..., Any]) -> None:
    outcome, _ = probe(FOUND, "--json")
    (document,) = outcome.json
    assert (document["port"], document["chip"], document["outcome"]) == (
        "/dev/ttyACM0",
        "Arduino Uno",
        "recognised",
    )
    speaks = document["speaks"]
    assert (speaks["protocol"], speaks["baud"], speaks["parity"], speaks["rate_hz"]) == (
        "csv",
        57600,
        "E",
        80.4,
    )
    assert speaks["verified"] == find_driver("csv").verified
    assert speaks["settings"] == COLUMNS
    assert speaks["command"].startswith("slipstand record --port /dev/ttyACM0")
    (held,) = probe(HELD, "--json")[0].json
    assert held["speaks"] is None
    assert held["holders"] == [{"process": 7, "program": "x"}]
    assert held["hints"] == [{"message": "it is held back", "remedy": "Ask for less"}]


def test_without_any_port(slipstand: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "present_ports", list)
    monkeypatch.setattr(device, "list_streams", list)
    assert "No serial port found" in slipstand("device", "probe").out
    assert slipstand("device", "probe", "--json").json == []


def test_streams_are_listed_and_probed_with_the_ports(
    slipstand: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = PortInfo("lsl://rig-7", "LSL stream My rig of lab-pc")
    found = Recognition("lsl", 1.0, 900, rate_hz=1000.0)
    asked = []

    def look(port: PortInfo, *_: Any) -> PortReport:
        asked.append(port)
        return PortReport(port, "", ProbeOutcome.RECOGNISED, recognition=found)

    monkeypatch.setattr(device, "present_ports", list)
    monkeypatch.setattr(device, "list_streams", lambda: [stream])
    monkeypatch.setattr(device, "probe_port", look)
    assert "lsl://rig-7" in slipstand("device", "ports").out
    said = slipstand("device", "probe").out
    assert "slipstand record --port lsl://rig-7 --protocol lsl\n" in said
    assert asked == [stream]
