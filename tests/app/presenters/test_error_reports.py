"""Faults of the program itself: said once, kept with all that is known, caught where nobody else does."""

import sys
import threading

import pytest

from app.presenters.error_reports import ErrorReport, ErrorReporter, error_report
from config.schema import ConfigError
from messages.message import EMPTY


def test_an_expected_error_speaks_for_itself() -> None:
    assert str(error_report(ConfigError("x = 3\n is wrong")).message) == "x = 3 is wrong"
    assert str(error_report(OSError()).message) == "OSError"


def test_a_fault_of_the_program_is_called_one_and_tells_where_it_was() -> None:
    with pytest.raises(KeyError) as caught:
        {}["gone"]
    fault = error_report(caught.value)
    assert str(fault.message).startswith("Slipstand itself failed (KeyError: 'gone')")
    assert "test_error_reports.py" in fault.details
    assert "\n" not in str(fault.message)


def test_a_repeated_error_is_reported_and_logged_once_in_a_while(caplog: pytest.LogCaptureFixture) -> None:
    at_s = 0.0
    faults = ErrorReporter(lambda: at_s)
    for _ in range(3):
        faults.report(ErrorReport("a", "trace of a"))
        at_s += 4.0
    faults.report(ErrorReport("b", "trace of b"))
    taken = [faults.next_report() for _ in range(4)]
    assert [fault.message if fault else "" for fault in taken] == ["a", "b", "", ""]
    assert caplog.text.count("trace of") == 2
    at_s += 11.0
    faults.report(ErrorReport("b", "trace of b"))
    assert faults.next_report() is not None


def test_what_nobody_catches_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module, name in ((sys, "excepthook"), (threading, "excepthook")):
        monkeypatch.setattr(module, name, getattr(module, name))  # put back afterwards
    faults = ErrorReporter()
    faults.install_hooks()
    sys.excepthook(ZeroDivisionError, ZeroDivisionError("nothing to divide by"), None)
    thread = threading.Thread(target=lambda: {}["nothing"])
    thread.start()
    thread.join()
    assert "ZeroDivisionError" in str((faults.next_report() or ErrorReport(EMPTY, "")).message)
    assert "KeyError" in str((faults.next_report() or ErrorReport(EMPTY, "")).message)
    assert "nothing to divide by" in capsys.readouterr().err, "a terminal is told as ever"
    sys.excepthook(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert faults.next_report() is None
