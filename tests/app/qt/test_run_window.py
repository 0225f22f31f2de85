"""The program as it is started: it opens, closes on Ctrl-C, and refuses in one line."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

WINDOW = """
import os, signal, sys, threading
from app.qt.main import run_window
threading.Timer(1.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
sys.exit(run_window())
"""
INTERRUPTED_EARLY = """
import os, signal, sys
from app.qt.main import run_window
from app.qt.window import MainWindow
show = MainWindow.show
MainWindow.show = lambda window: (show(window), os.kill(os.getpid(), signal.SIGINT))
sys.exit(run_window())
"""
INTERRUPTED_BEFORE = """
import os, signal, sys
from app.qt.main import run_window
from app.qt.window import MainWindow
build = MainWindow.__init__
def interrupted(window, *arguments):
    os.kill(os.getpid(), signal.SIGINT)
    build(window, *arguments)
MainWindow.__init__ = interrupted
sys.exit(run_window())
"""
RUN_NAMED = """
import os, signal, sys
from app.__main__ import main
from app.presenters.window import WindowPresenter
open_run = WindowPresenter.open_run
def interrupted(window, path):
    open_run(window, path)
    os.kill(os.getpid(), signal.SIGINT)
WindowPresenter.open_run = interrupted
sys.argv = ["slipstand", {path!r}]
main()
"""
NOWHERE = {"QT_QPA_PLATFORM": None, "DISPLAY": None, "WAYLAND_DISPLAY": None}
REFUSED = """
import sys
from PySide6.QtWidgets import QMessageBox
QMessageBox.exec = lambda box: sys.stdout.write(box.text())
from app.qt.main import run_window
sys.exit(run_window())
"""


def run(code: str, **changes: str | None) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh interpreter with a changed environment."""
    environment = {**os.environ, **{name: value for name, value in changes.items() if value is not None}}
    for name in (name for name, value in changes.items() if value is None):
        environment.pop(name, None)
    command = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")
@pytest.mark.parametrize(
    "code", [WINDOW, INTERRUPTED_EARLY, INTERRUPTED_BEFORE], ids=["open", "opening", "before"]
)
def test_the_window_opens_and_closes_on_ctrl_c_and_keeps_how_it_was_left(code: str, tmp_path: Path) -> None:
    (tmp_path / "window.toml").write_text('screen = "settings"\nwidth = 1100\nheight = 700\n')
    (tmp_path / "settings.toml").write_text('theme = "dark"\nlanguage = "ru"\n')
    result = run(code, SLIPSTAND_CONFIG=str(tmp_path))
    assert result.returncode == 130, result.stderr
    assert "Traceback" not in result.stderr
    left = tomllib.loads((tmp_path / "window.toml").read_text(encoding="utf-8"))
    assert left["screen"] == "settings"
    assert left["width"] > 0
    assert (tmp_path / "settings.toml").read_text() == 'theme = "dark"\nlanguage = "ru"\n'


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there always is a display")
def test_without_a_display_one_line_says_so() -> None:
    result = run("import sys; from app.qt.main import run_window; sys.exit(run_window())", **NOWHERE)
    assert result.returncode == 1
    assert result.stderr.startswith("error: there is no display here.")
    assert result.stderr.count("\n") == 1


def test_a_settings_file_that_cannot_be_used_is_said(tmp_path: Path) -> None:
    (tmp_path / "stand.toml").write_text("name = 3\n", encoding="utf-8")
    result = run(REFUSED, SLIPSTAND_CONFIG=str(tmp_path))
    assert result.returncode == 1
    (line,) = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert "stand.toml" in line
    assert "stand.toml" in result.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")
def test_a_run_that_is_named_is_opened(tmp_path: Path, short_runs: list[Path]) -> None:
    result = run(RUN_NAMED.format(path=str(short_runs[0])), SLIPSTAND_CONFIG=str(tmp_path))
    assert result.returncode == 130, result.stderr
    assert "Traceback" not in result.stderr
    (recent,) = tomllib.loads((tmp_path / "recent.toml").read_text(encoding="utf-8"))["runs"]
    assert Path(recent) == short_runs[0]


def test_a_run_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    result = run(RUN_NAMED.format(path="absent.h5"), SLIPSTAND_CONFIG=str(tmp_path))
    assert result.returncode == 1
    assert result.stderr.startswith("error: absent.h5: there is no such file.")
    assert result.stderr.count("\n") == 1


def test_the_window_has_an_icon() -> None:
    code = """
import sys
from PySide6.QtGui import QGuiApplication
from app.presenters.window import WindowPresenter
def opened(presenter, series):
    sys.stdout.write(str(QGuiApplication.windowIcon().isNull()))
    presenter.close_window()
WindowPresenter.open_simulated = opened
from app.__main__ import main
sys.argv = ["slipstand", "--simulated"]
main()
"""
    result = run(code)
    assert (result.returncode, result.stdout) == (0, "False"), result.stderr


def test_a_system_without_the_libraries_of_qt_is_told_in_one_line() -> None:
    code = """
import sys
class Missing:
    def find_spec(self, name, *_):
        if name == "PySide6.QtGui":
            raise ImportError("libGL.so.1: cannot open shared object file: No such file or directory")
sys.meta_path.insert(0, Missing())
from app.__main__ import main
sys.argv = ["slipstand"]
main()
"""
    result = run(code)
    assert (result.returncode, result.stderr.count("\n")) == (1, 1)
    assert "libGL.so.1" in result.stderr
    assert "apt-get install" in result.stderr
