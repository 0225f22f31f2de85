"""Modules that a fresh interpreter loads: no Qt for numbers, no HDF5 for settings."""

import subprocess
import sys

import pytest

QT = ("PySide6", "pyqtgraph", "qtpy", "qtawesome")
HEAVY = (*QT, "serial", "h5py", "matplotlib")


def loaded_after(statement: str) -> set[str]:
    """Top-level modules in a fresh interpreter after `statement`."""
    code = f"{statement}\nimport sys\nsys.stderr.write(' '.join({{m.split('.')[0] for m in sys.modules}}))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(result.stderr.split())


@pytest.mark.parametrize("module", ["config.files", "drivers.source", "analysis.identify"])
def test_libraries_load_no_qt_serial_h5py_or_matplotlib(module: str) -> None:
    assert not loaded_after(f"import {module}") & set(HEAVY)


@pytest.mark.parametrize("module", ["app.acquisition.engine", "app.presenters.composition", "app.runs.paths"])
def test_neither_engine_nor_the_start_of_the_window_loads_h5py(module: str) -> None:
    """It takes a while to load, and where a disk is full it can crash its process."""
    assert not loaded_after(f"import {module}") & {"h5py", "matplotlib", *QT}


@pytest.mark.parametrize("module", ["drivers.port", "app.runs.run_filter"])
def test_ports_are_listed_and_runs_are_told_of_without_them_too(module: str) -> None:
    assert not loaded_after(f"import {module}") & {"numba", "scipy", "h5py", "matplotlib"}


@pytest.mark.parametrize("screen", ["campaign", "gauges", "identify", "record", "runs"])
def test_a_screen_opens_without_the_libraries_of_analysis(screen: str) -> None:
    """Its modules are loaded in the window's thread, which stands still for as long."""
    assert not loaded_after(f"import app.qt.{screen}.screen") & {"numba", "scipy", "h5py", "matplotlib"}


@pytest.mark.parametrize(
    "arguments", [["--version"], ["--help"], ["simulate", "--series", "1FFM0", "--json"], ["device", "list"]]
)
def test_the_command_line_loads_no_qt(arguments: list[str]) -> None:
    statement = (
        f"import sys; sys.argv = ['slipstand', *{arguments!r}]\n"
        "from app.__main__ import main\n"
        "try: main()\n"
        "except SystemExit as e: assert not e.code, e.code"
    )
    assert not loaded_after(statement) & set(QT)
