"""The import contracts hold, and each one notices a planted violation."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("app", "analysis", "config", "drivers", "messages", "slipstand")

VIOLATIONS = [
    pytest.param("analysis/record.py", "import config.schema", "stands above", id="analysis-knows-config"),
    pytest.param("config/schema.py", "import drivers.samples", "stands above", id="config-knows-drivers"),
    pytest.param("drivers/samples.py", "import app.version", "stands above", id="drivers-know-app"),
    pytest.param("app/version.py", "import slipstand.runs", "stands above", id="app-knows-slipstand"),
    pytest.param("app/runs/__init__.py", "import app.cli", "inside app", id="runs-know-cli"),
    pytest.param("app/presenters/__init__.py", "import app.qt", "inside app", id="presenters-know-views"),
    pytest.param("app/newcomer.py", "import json", "inside app", id="module-outside-the-layers"),
    pytest.param("app/presenters/__init__.py", "import PySide6.QtCore", "Qt only", id="qt-in-presenter"),
    pytest.param("analysis/record.py", "import pyqtgraph", "Qt only", id="pyqtgraph-in-analysis"),
    pytest.param(
        "drivers/recognition.py", "import drivers.stream", "inside drivers", id="recognition-knows-stream"
    ),
    pytest.param(
        "drivers/devices/harp/codec.py",
        "import drivers.devices.gsv.codec",
        "device folders",
        id="device-knows-device",
    ),
    pytest.param(
        "app/presenters/identify/presenter.py",
        "import app.presenters.record.state",
        "inside presenters",
        id="screen-knows-screen",
    ),
    pytest.param(
        "app/presenters/record/reducer.py",
        "import app.presenters.worker",
        "states and reducers",
        id="reducer-knows-workers",
    ),
    pytest.param("drivers/samples.py", "import serial", "pyserial only", id="serial-outside-port"),
    pytest.param("app/acquisition/__init__.py", "import h5py", "h5py only", id="h5py-outside-runs"),
]


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run import-linter on the packages in `folder`, without its cache."""
    return subprocess.run(
        [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()", "--no-cache"],
        cwd=folder,
        env={"PYTHONPATH": str(folder), "PATH": "", "SYSTEMROOT": "", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A copy of the packages and their contracts."""
    for package in PACKAGES:
        shutil.copytree(
            ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc")
        )
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def test_the_contracts_hold(house: Path) -> None:
    result = lint(house)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(("module", "line", "contract"), VIOLATIONS)
def test_a_planted_violation_is_noticed(house: Path, module: str, line: str, contract: str) -> None:
    target = house / module
    text = target.read_text(encoding="utf-8") if target.exists() else ""
    target.write_text(text + f"\n{line}\n", encoding="utf-8")
    result = lint(house)
    assert result.returncode != 0
    assert contract in result.stdout
