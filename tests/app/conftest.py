"""Puts the fakes of this folder (`stage.py`) within reach of the tests below it."""

import datetime
import itertools
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from app.runs import file_operations, listing, reader
from app.runs.exchange import exporting
from app.runs.validator import Validator, shared_validator
from tests.waiting import PATIENCE_S

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

    from app.qt.theme import Theme


class KeptValidator:
    """Stands for `Validator` where one is started for each run or folder: one process serves all tests."""

    @classmethod
    def start(cls) -> "KeptValidator":
        return cls()

    def __enter__(self) -> Validator:
        return shared_validator()

    def __exit__(self, *_: object) -> None: ...


@pytest.fixture(autouse=True, scope="session")
def keep_validator() -> Iterator[None]:
    """Start that process before a test counts its children. One for each open file takes 0.4 s."""
    shared_validator()
    with pytest.MonkeyPatch.context() as patch:
        for module in (reader, listing, file_operations, exporting):
            patch.setattr(module, "Validator", KeptValidator)
        yield


@pytest.fixture(autouse=True)
def keep_interrupts() -> Iterator[None]:
    """A command leaves Ctrl-C ignored, since its process ends then; that of the tests goes on."""
    before = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def unused_folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folders to make. `mktemp` would look for the next number among those of all tests before, each time."""
    parent = tmp_path_factory.mktemp("own")
    return (parent / str(number) for number in itertools.count())


@pytest.fixture(autouse=True)
def cache_folder(unused_folders, monkeypatch):
    """A cache folder of the test's own, so that no index is left in the user's."""
    place = next(unused_folders)
    place.mkdir()
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_arguments, **_options: str(place))
    return place


@pytest.fixture(autouse=True)
def data_folder(unused_folders, monkeypatch):
    """A data folder of the test's own on Linux and Windows, for the processes that it starts too."""
    place = next(unused_folders)
    place.mkdir()
    for name in ("XDG_DATA_HOME", "WIN_PD_OVERRIDE_LOCAL_APPDATA"):  # the latter is platformdirs' own
        monkeypatch.setenv(name, str(place))
    return place


@pytest.fixture(scope="session")
def only_theme(qapp: "QApplication") -> "Theme":
    """The one theme of a process: a second one would set the colours of the first to its own."""
    from PySide6.QtCore import Qt

    from app.qt.theme import Theme

    return Theme(qapp, Qt.ColorScheme.Light)


@pytest.fixture
def theme(only_theme: "Theme") -> "Iterator[Theme]":
    """The theme, light again after the test."""
    from PySide6.QtCore import Qt

    yield only_theme
    if only_theme._fixed is not Qt.ColorScheme.Light:
        only_theme.fix(Qt.ColorScheme.Light)


@pytest.fixture(scope="session")
def short_runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short synthetic runs of two series, not to be changed."""
    from app.simulated_stand.synthetic_campaign import CampaignOptions, plan_tests, write_test
    from config.files import load_gauges, load_stand

    began = datetime.datetime(2026, 11, 21, 8, 0, tzinfo=datetime.UTC)
    options = CampaignOptions(series=("1FFM0", "2SSM1"), repeats=1, rate_hz=300.0, duration_s=5.0)
    tests = plan_tests(options, load_stand(), load_gauges(), tmp_path_factory.mktemp("short"), began)
    return [Path(write_test(test).path) for test in tests]


@pytest.fixture
def unhurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read all of the last runs: on a busy computer a few take longer than the program waits for them."""
    monkeypatch.setattr("app.runs.campaign.last_runs._LONGEST_S", PATIENCE_S)


@pytest.fixture(scope="session")
def real_stand_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of three analysed runs, not to be changed: a second mode in all, a long release in one."""
    from app.runs.analysis_request import AnalysisRequest
    from app.runs.analyze import analyze_run
    from app.simulated_stand.synthetic_campaign import CampaignOptions, plan_tests, write_test
    from config.files import load_gauges, load_stand

    folder = tmp_path_factory.mktemp("real-stand")
    began = datetime.datetime(2026, 11, 21, 8, 0, tzinfo=datetime.UTC)
    mode = {"second-mode": 0.03}
    for number, effects in enumerate((mode, mode, mode | {"release-ramp": 0.02})):
        options = CampaignOptions(
            series=("1FFM0",), repeats=1, seed=number, rate_hz=500.0, duration_s=5.0, effects=effects
        )
        begins = began + datetime.timedelta(hours=number)
        for test in plan_tests(options, load_stand(), load_gauges(), folder, begins):
            path = Path(write_test(test).path)
            analyze_run(path, AnalysisRequest(classical=False), save=True, trusted=True)
    return folder


@pytest.fixture
def symbolic_links(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Skip where links cannot be made, as by most accounts of Windows, or are not followed, as under Wine."""
    target = tmp_path_factory.mktemp("links") / "target"
    target.write_text("there")
    link = target.with_name("link")
    try:
        link.symlink_to(target.name)
        is_followed = link.read_text() == "there"
    except OSError:
        is_followed = False
    if not is_followed:
        pytest.skip("no symbolic links here")
