"""What the program keeps for itself is only this user's, and no link makes it write elsewhere."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.motion.two_mass import TwoMassParameters
from app.acquisition.journal.file import create_journal_file
from app.acquisition.ring import create_ring, live_folder
from app.runs.disk import temporary_copy
from app.runs.edits import edit_run
from app.runs.errors import UnsuitableRunError
from app.runs.journal import RecordKind, encode_record
from app.runs.lock import recording_lock
from app.runs.paths import is_own_folder, make_private_folder
from app.runs.simulated import write_simulated_run
from config.files import load_gauges
from drivers.simulated.transport import open_pseudo_terminal

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="Windows gives each user folders of their own"
)
second_user = pytest.mark.skipif(
    sys.platform == "win32" or os.geteuid() != 0 or shutil.which("setpriv") is None,
    reason="only root may act as a second user",
)
NOBODY = 65534
FIRST = encode_record(b"{}", 0, RecordKind.NOTE)


@pytest.fixture
def run_path(tmp_path) -> Path:
    parameters = TwoMassParameters.from_free_decay(
        period_s=0.32,
        damping_n1_per_s=0.12,
        table_mass_kg=131.6,
        plate_mass_kg=22.4,
        friction_dynamic=0.1,
        pullback_m=0.012,
    )
    path = tmp_path / "runs" / "run.h5"
    path.parent.mkdir()
    write_simulated_run(path, parameters.simulate(2.0), parameters, rate_hz=200.0)
    return path


def can_reach(path: Path) -> bool:
    """Tell whether another user can read or write a path."""
    tests = " || ".join(f"test -{way} {path}" for way in "rw")
    command = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups", "sh", "-c", tests]
    return subprocess.run(command, check=False).returncode == 0


@second_user
def test_another_user_reaches_neither_ring_nor_port_nor_kept_journals(tmp_path):
    assert can_reach(Path("/etc/passwd")), "the other user can look at all"
    with live_folder() as folder, create_ring(folder / "live.ring", 100, 500.0, load_gauges()) as ring:
        assert not can_reach(ring.path)
    port = open_pseudo_terminal()
    try:
        assert not can_reach(Path(port.url))
        assert not can_reach(Path(port.url).resolve())
    finally:
        port.close()
    kept = Path("/tmp") / f"slipstand-test-{os.getpid()}"
    make_private_folder(kept)
    try:
        (kept / "run.journal").touch()
        assert not can_reach(kept / "run.journal")
    finally:
        shutil.rmtree(kept)


@second_user
def test_a_folder_that_another_user_made_first_is_not_used(tmp_path):
    trap = tmp_path / "journals"
    trap.mkdir(mode=0o777)
    os.chown(trap, NOBODY, NOBODY)
    with pytest.raises(PermissionError):
        make_private_folder(trap)
    assert not is_own_folder(trap)


@pytest.mark.usefixtures("symbolic_links")
def test_a_journal_does_not_move_through_a_link(tmp_path):
    elsewhere, trap, good = tmp_path / "elsewhere", tmp_path / "trap", tmp_path / "good"
    elsewhere.mkdir()
    trap.symlink_to(elsewhere)
    journal = create_journal_file(tmp_path / "run.journal", FIRST, [trap, good])
    journal._move(OSError(28, "injected"))
    assert journal.path == good / "run.journal"
    assert list(elsewhere.iterdir()) == []
    journal.close()
    journal.release()


@pytest.mark.usefixtures("symbolic_links")
def test_a_lock_makes_no_file_elsewhere(tmp_path):
    lock = recording_lock(tmp_path / "run.h5")
    lock.path.symlink_to(tmp_path / "victim")
    with pytest.raises(OSError, match="symbolic link"):
        lock.acquire()
    assert not (tmp_path / "victim").exists()


@pytest.mark.usefixtures("symbolic_links")
def test_an_edit_writes_through_no_link(tmp_path, run_path):
    victim = tmp_path / "victim"
    victim.write_text("kept")
    temporary_copy(run_path).symlink_to(victim)
    edit_run(run_path, "A", note="edited")
    assert victim.read_text() == "kept"
    link = tmp_path / "link.h5"
    link.symlink_to(run_path)
    with pytest.raises(UnsuitableRunError, match="is a link to"):
        edit_run(link, "A", note="again")
