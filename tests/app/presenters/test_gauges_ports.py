"""What was found on a port, as the Gauges screen says it, and what it fills in on the start page."""

import sys
import threading
import time
from collections.abc import Callable

import pytest

from app.presenters.base import Progress, Tone
from app.presenters.gauges import port_tasks
from app.presenters.gauges.port_tasks import list_port_cards, listed_port, probe_ports, probed_port
from app.presenters.start_screen import port_settings
from drivers.host_checks import PortHint
from drivers.port import PortInfo, PortUser
from drivers.port_probe import LineSettings, PortReport, ProbeOutcome
from drivers.recognition import Recognition
from drivers.registry import find_driver
from messages.message import message, option

ARDUINO = PortInfo("/dev/ttyACM0", "n/a", 0x2341, 0x43, "75")
COLUMNS = {"columns": "table,relative", "separator": "semicolon"}
LINES = Recognition("csv", 0.99, 300, settings=COLUMNS, rate_hz=80.4, needs_rate=True)
SCALE = Recognition("csv", 1.0, 30, channels=1, settings={"format": "openscale"}, rate_hz=10.0)


def test_a_port_bears_its_chip_and_usb_numbers() -> None:
    assert listed_port(ARDUINO).identity == "Arduino Uno, USB 2341:0043 75"
    assert listed_port(PortInfo("/dev/ttyS0", "n/a")).identity == ""


def test_what_speaks_is_said_and_connects_as_suggested() -> None:
    report = PortReport(
        ARDUINO,
        "Arduino Uno",
        ProbeOutcome.RECOGNISED,
        recognition=LINES,
        line_settings=LineSettings(57600, "E"),
    )
    card = probed_port(report)
    assert card.status.tone is Tone.OK
    assert card.status.text.endswith("at 57600 baud 8E1")
    assert card.description == (f"2 gauges, 80.4\u202fHz; {find_driver('csv').verified}",)
    assert card.suggested_form is not None
    settings = port_settings(card.suggested_form)
    assert (settings.url, settings.protocol, settings.baud, settings.parity) == (
        "/dev/ttyACM0",
        "csv",
        57600,
        "E",
    )
    assert settings.rate_hz == 80.4
    assert settings.device == COLUMNS
    assert not card.needs_second


def test_that_a_device_is_unverified_and_its_line_are_told_in_the_language_of_the_window(
    use_language: Callable[[str], None],
) -> None:
    use_language("ru")
    card = probed_port(
        PortReport(ARDUINO, "", ProbeOutcome.RECOGNISED, recognition=LINES, line_settings=LineSettings(57600))
    )
    assert "; не проверено на приборе" in card.description[0]
    assert card.status.text.endswith(" на 57600 бод 8N1")


def test_a_device_of_one_gauge_wants_another_and_its_usual_baud_is_left_to_it() -> None:
    card = probed_port(
        PortReport(ARDUINO, "", ProbeOutcome.RECOGNISED, recognition=SCALE, line_settings=LineSettings(9600))
    )
    assert card.description[0].startswith("1 gauge, so choose the port of gauge 2 too")
    assert card.suggested_form is not None
    assert card.suggested_form.baud == ""
    assert card.needs_second


@pytest.mark.parametrize(
    ("outcome", "tone"),
    [
        (ProbeOutcome.IN_USE, Tone.WARN),
        (ProbeOutcome.SILENT, Tone.PLAIN),
        (ProbeOutcome.UNAVAILABLE, Tone.BAD),
    ],
)
def test_what_stands_in_the_way_is_said_with_its_remedy(outcome: ProbeOutcome, tone: Tone) -> None:
    hint = PortHint("it is held back", "Ask for less")
    reason = message(
        "nothing sends by itself: try {option}, which asks the device who it is", option=option("--write")
    )
    assert "--write" in str(reason)
    card = probed_port(PortReport(ARDUINO, "", outcome, reason, (PortUser(7, "x"),), hints=(hint,)))
    assert card.status.tone is tone
    assert "--write" not in card.description[0], "that is an option of the command line"
    assert card.description[1] == "it is held back. Ask for less"
    assert card.suggested_form is None


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX")
def test_a_port_is_really_listened_to_and_a_connected_one_left_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from drivers.simulated.transport import open_pseudo_terminal

    terminal = open_pseudo_terminal()
    ended = threading.Event()

    def send() -> None:
        for number in range(1_000_000):
            if ended.is_set():
                return
            terminal.send(f"{number * 10_000},{100 + number % 7},{-50 - number % 5}\n".encode())
            time.sleep(0.01)

    there = [PortInfo(terminal.url), PortInfo("COM7")]
    monkeypatch.setattr(port_tasks, "list_ports", lambda: there)
    monkeypatch.setattr(port_tasks, "list_streams", list)
    told: list[Progress] = []
    sender = threading.Thread(target=send)
    sender.start()
    try:
        cards = probe_ports(False, "COM7", told.append)
    finally:
        ended.set()
        sender.join()
        terminal.close()
    assert cards[0].suggested_form is not None
    assert cards[0].suggested_form.protocol == "csv"
    assert "listening" in told[-1].text
    assert cards[1].status.text == "connected here"
    assert [card.url for card in list_port_cards()] == [terminal.url, "COM7"]
