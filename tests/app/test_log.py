"""The log: one file a kind of process, which rotates, at a level that child processes inherit."""

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app import log


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv(log.FOLDER_VARIABLE, str(tmp_path / "logs"))
    monkeypatch.setenv(log.LEVEL_VARIABLE, "info")
    yield tmp_path / "logs"
    log.start_log("after")


def lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def test_each_kind_of_process_has_its_file(folder: Path) -> None:
    log.start_log("engine")
    logging.getLogger("drivers.port").info("opened %s", "COM3")
    logging.getLogger("drivers.port").debug("not at this level")
    logging.getLogger("matplotlib").info("nor of libraries")
    assert [line.split(": ", 1)[1] for line in lines(folder / "engine.log")[1:]] == ["opened COM3"]
    assert "engine of Slipstand" in lines(folder / "engine.log")[0]


def test_starting_again_writes_each_line_once(folder: Path) -> None:
    log.start_log("window")
    log.start_log("window", "debug")
    logging.getLogger("app.qt").debug("a line")
    assert sum(line.endswith("a line") for line in lines(folder / "window.log")) == 1


def test_child_processes_inherit_the_level(folder: Path) -> None:
    log.start_log("window", "debug")
    code = "from app.log import start_log; start_log('child'); import logging; "
    code += "logging.getLogger('app').debug('x')"
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))
    assert lines(folder / "child.log")[-1].endswith("x")


def test_an_unknown_level_is_info_and_a_folder_in_the_way_is_no_fault(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.write_text("")
    monkeypatch.setenv(log.LEVEL_VARIABLE, "loud")
    log.start_log("engine")
    logging.getLogger("app").error("goes nowhere")
    assert os.environ[log.LEVEL_VARIABLE] == "info"


def test_a_full_file_is_kept_and_a_new_one_begun(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log, "_LARGEST_BYTES", 2000)
    log.start_log("engine")
    for number in range(200):
        logging.getLogger("app").info("line %d", number)
    assert sorted(path.name for path in folder.iterdir()) == ["engine.log", "engine.log.1", "engine.log.2"]
    assert lines(folder / "engine.log")[-1].endswith("line 199")


def test_verbose_commands_log_to_stderr(folder: Path) -> None:
    command = [sys.executable, "-m", "app", "--verbose", "device", "list"]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "command of Slipstand" in result.stderr
    assert "DEBUG" in (folder / "command.log").read_text() or lines(folder / "command.log")
