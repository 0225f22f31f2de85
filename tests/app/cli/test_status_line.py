"""The line that follows a run."""

import io
import sys

import pytest

from analysis.quantities import Quantity
from app.acquisition.messages import Health, LiveResult
from app.cli.progress_printer import StatusLine, result_text

KNOWN = LiveResult(
    4.0,
    friction_dynamic=Quantity.normal(0.10003, 0.00021, "1"),
    period=Quantity.normal(0.32, 2.9e-5, "s"),
    damping_n1=Quantity.normal(0.1213, 0.0021, "1/s"),
    law="coulomb",
)
SAID = "T = 320.000 ± 0.029 ms  n1 = 0.1213 ± 0.0021 1/s  f_d = 0.10003 ± 0.00021"


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_what_is_known_is_one_line():
    assert result_text(KNOWN) == SAID
    assert result_text(LiveResult(1.0)) == ""
    assert result_text(LiveResult(1.0, period=KNOWN.period)) == "T = 320.000 ± 0.029 ms"


def test_when_to_stop_is_said():
    by_plate = LiveResult(1.0, friction_dynamic_plate=KNOWN.friction_dynamic)
    assert result_text(by_plate).startswith("f_dp = 0.1")

    stop = LiveResult(5.0, friction_dynamic=KNOWN.friction_dynamic, may_stop=True)
    assert result_text(stop) == "f_d = 0.10003 ± 0.00021  (waiting does not narrow f_d)"


def test_into_a_file_it_is_written_now_and_then(capsys):
    with StatusLine() as line:
        for event in [Health(1000.0, 1, 0, 0, 0, 0, 1), LiveResult(1.0), *[KNOWN] * 20]:
            line.on_event(event)
        line.on_event(LiveResult(4.1, message="gone"))
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines() == [SAID, "gone"]


def test_on_a_terminal_it_is_redrawn_and_gone_at_the_end(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with StatusLine() as line:
        line.on_event(KNOWN)
    assert "320.000" in screen.getvalue()
    assert screen.getvalue().rstrip().endswith("\x1b[2K")


@pytest.mark.parametrize("message", ["the live identification ended by itself"])
def test_an_end_is_told_also_on_a_terminal(monkeypatch, message):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    with StatusLine() as line:
        line.on_event(LiveResult(4.1, message=message))
    assert message in screen.getvalue()
