"""Faults of the program itself: said once, kept with all that is known, caught where nobody else does."""

import sys
import threading
from pathlib import Path

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


def test_the_same_again_and_again_is_said_once_in_a_while(tmp_path: Path) -> None:
    at_s = 0.0
    faults = ErrorReporter(tmp_path / "logs" / "faults.log", lambda: at_s)
    for _ in range(3):
        faults.report(ErrorReport("a", "trace of a"))
        at_s += 4.0
    faults.report(ErrorReport("b", "trace of b"))
    taken = [faults.next_report() for _ in range(4)]
    assert [fault.message if fault else "" for fault in taken] == ["a", "b", "", ""]
    assert (tmp_path / "logs" / "faults.log").read_text().count("trace of") == 2
    at_s += 11.0
    faults.report(ErrorReport("b", "trace of b"))
    assert faults.next_report() is not None


def test_a_full_log_is_kept_once_more(tmp_path: Path) -> None:
    log = tmp_path / "faults.log"
    log.write_text("x" * 1_000_001)
    ErrorReporter(log).report(ErrorReport("a", "trace"))
    assert "trace" in log.read_text()
    assert (tmp_path / "faults.log.old").stat().st_size == 1_000_001


def test_what_cannot_be_logged_is_still_told(tmp_path: Path) -> None:
    (tmp_path / "in the way").write_text("")
    faults = ErrorReporter(tmp_path / "in the way" / "faults.log")
    faults.report(ErrorReport("a", "trace"))
    assert faults.next_report() == ErrorReport("a", "trace")


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
