"""Many runs analysed for the window: by the rules of the command line, in processes that leave nothing."""

import multiprocessing
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.presenters.base import Progress
from app.presenters.runs.state import RunAnalysed
from app.presenters.runs.tasks import analyse_runs, list_folder
from app.presenters.worker import Worker
from app.runs.edits import edit_run
from app.runs.lock import recording_lock
from app.runs.reader import open_run
from tests.drills.processes import descendants_of, gone
from tests.waiting import wait_until


@pytest.fixture
def folder(short_runs: list[Path], tmp_path: Path) -> Path:
    for run in short_runs:
        shutil.copy(run, tmp_path)
    return tmp_path


@pytest.fixture
def worker() -> Iterator[Worker]:
    made = Worker()
    yield made
    made.close()


def came(*paths: str, reanalyse: bool = False) -> list[RunAnalysed]:
    said: list[Any] = []
    analyse_runs(paths, reanalyse, said.append)
    return [progress for progress in said if isinstance(progress, RunAnalysed)]


def test_a_second_pass_leaves_out_what_is_up_to_date_as_the_command_line_does(folder: Path) -> None:
    paths = tuple(sorted(str(path) for path in folder.iterdir()))
    assert [one.is_up_to_date for one in came(*paths)] == [False, False]
    edit_run(Path(paths[1]), "Ada", table_mass_kg=140.0)
    assert [one.is_up_to_date for one in came(*paths)] == [True, False]
    assert [one.is_up_to_date for one in came(paths[0], reanalyse=True)] == [False]
    assert [len(open_run(path).analyses) for path in paths] == [2, 2]


def test_runs_that_fail_are_named_and_the_rest_is_done(folder: Path) -> None:
    (folder / "torn.h5").write_text("no run")
    (good, *_) = (path for path in folder.iterdir() if path.name != "torn.h5")
    torn, lost = folder / "torn.h5", folder / "lost.h5"
    first, second, third = came(str(torn), str(lost), str(good))
    assert first.fault.startswith("torn.h5 is not an HDF5 file")
    assert second.fault.startswith("lost.h5: there is no such file")
    assert third == RunAnalysed(str(good))


def test_it_is_told_which_run_is_waited_for(folder: Path) -> None:
    paths = tuple(str(folder / name) for name in ("none.h5", "neither.h5"))
    said: list[Any] = []
    analyse_runs(paths, False, said.append)
    assert said[0] == Progress("Analysing none, 1 of 2", 0.0)
    assert Progress("Analysing neither, 2 of 2", 0.5) in said


def test_giving_up_many_keeps_what_is_done_and_leaves_no_process(
    short_runs: list[Path], tmp_path: Path, worker: Worker
) -> None:
    paths = tuple(str(shutil.copy(short_runs[0], tmp_path / f"run_{number:02d}.h5")) for number in range(12))
    said: list[Any] = []
    worker.submit(analyse_runs, paths, False, progress=said.append)
    done: list[RunAnalysed] = []

    def has_come() -> bool:
        worker.poll()
        done.extend(progress for progress in said if isinstance(progress, RunAnalysed))
        return bool(done)

    wait_until(has_come)
    (child,) = multiprocessing.active_children()
    running = [child.pid, *descendants_of(child.pid or 0)]
    worker.cancel()
    assert done[0].fault == ""
    assert all(gone(number) for number in running if number)
    assert len(open_run(done[0].path).analyses) == 1
    assert not [path.name for path in tmp_path.iterdir() if path.suffix != ".h5"]


def test_a_run_that_is_recorded_now_is_not_called_unreadable(folder: Path) -> None:
    (folder / "now.h5").write_text("not yet")
    with recording_lock(folder / "now.h5"):
        assert len(list_folder(str(folder), False, lambda _: None)) == 2
    assert [run.path for run in list_folder(str(folder), False, lambda _: None) if run.fault] == [
        str(folder / "now.h5")
    ]
