"""`slipstand doctor`: every finding that is not ok has a remedy."""

import datetime
import json
import os
import shlex
import zipfile
from pathlib import Path
from typing import Any

import pytest

from app.cli.doctor import FindingState, compilation, folders, installation, ports
from app.cli.doctor.folders import check_calibration, check_synchronised
from app.runs.errors import DiskFullError
from app.runs.journal import MAGIC, SUFFIX
from config.files import append_check, checks_path, load_gauges, save_calibration, settings_file
from config.schema import GaugeCheck
from drivers.host_checks import PortHint
from drivers.port import PortInfo, PortUser

FTDI = PortInfo("/dev/ttyUSB7", "FT232R", 0x0403, 0x6001, "A1")


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Settings and recordings of the test's own; no port, and no journal of the user's."""
    (tmp_path / "settings").mkdir()
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "settings"))
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "runs"))
    monkeypatch.setattr(folders, "journal_fallback_folders", lambda: [tmp_path / "refuge"])
    monkeypatch.setattr(ports, "list_ports", list)
    return tmp_path


def found(outcome: Any) -> dict[str, dict[str, str]]:
    return {check["subject"]: check for check in outcome.json["checks"]}


def test_a_good_installation_is_well(slipstand: Any, own_folders: Path) -> None:
    outcome = slipstand("doctor", "--json")
    checks = found(outcome)

    assert outcome.code == 0, outcome.out
    assert outcome.json["ok"]
    assert "fail" not in [check["state"] for check in checks.values()]
    assert "h5py 3." in checks["libraries"]["message"]
    assert checks["examining runs"]["state"] == "ok"
    assert str(own_folders / "runs") in checks["recordings"]["message"]
    assert "SLIPSTAND_RECORDINGS, made by the first run" in checks["recordings"]["message"]
    assert f"{own_folders / 'settings'} (SLIPSTAND_CONFIG)" in checks["settings"]["message"]
    assert checks["gauges.toml"]["message"].endswith("(shipped)")
    assert not (own_folders / "runs").exists()
    assert all(check["remedy"] for check in checks.values() if check["state"] != "ok")


def test_a_wrong_settings_file_fails_with_its_line(slipstand: Any, own_folders: Path) -> None:
    path = own_folders / "settings" / "gauges.toml"
    path.write_text("[table]\ngain_m_per_count = 0\nzero_count = 0\n")
    outcome = slipstand("doctor")
    assert outcome.code == 1
    assert f"fail  gauges.toml: {path}: table: gain_m_per_count = 0" in outcome.out
    assert f"      Correct {path}" in outcome.out


def test_recordings_in_a_file_fail(
    slipstand: Any, own_folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (own_folders / "taken").write_text("")
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(own_folders / "taken" / "runs"))
    outcome = slipstand("doctor", "--json")
    assert outcome.code == 1
    assert "is no folder" in found(outcome)["recordings"]["message"]


def test_a_folder_that_takes_no_files_fails(slipstand: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(folder: Path) -> None:
        raise DiskFullError(f"{folder}: the disk or its quota is full")

    monkeypatch.setattr(folders, "check_folder", full)
    outcome = slipstand("doctor", "--json")
    assert outcome.code == 1
    assert found(outcome)["recordings"]["state"] == "fail"


@pytest.mark.parametrize(
    ("place", "name"),
    [
        ("OneDrive/Documents/Slipstand", "OneDrive"),
        ("OneDrive - University of Somewhere/Slipstand", "OneDrive - University of Somewhere"),
        ("Cloud/Slipstand", "Cloud"),
        ("Documents/Slipstand", None),
    ],
)
def test_a_folder_that_is_copied_elsewhere_while_runs_are_written_is_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, name: str | None
) -> None:
    monkeypatch.setenv("OneDriveCommercial", str(tmp_path / "CLOUD"))
    told = list(check_synchronised(tmp_path / place))
    assert [finding.state for finding in told] == ([FindingState.WARN] if name else [])
    assert all(f"lies in {name}," in finding.message and finding.remedy for finding in told)


def test_a_folder_is_tried_rather_than_asked_for_its_rights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    assert "beside the code" in installation.check_compiled_code(tmp_path).message
    monkeypatch.setattr(
        "tempfile.TemporaryFile", refuse
    )  # as in Program Files, which os.access takes for open
    assert "is read-only" in installation.check_compiled_code(tmp_path).message


def test_runs_that_were_cut_short_are_a_warning_only(slipstand: Any, own_folders: Path) -> None:
    runs = own_folders / "runs"
    runs.mkdir()
    (runs / f"cut{SUFFIX}").write_bytes(MAGIC)
    outcome = slipstand("doctor", "--json")
    assert outcome.code == 0
    check = found(outcome)["unfinished runs"]
    assert (check["state"], check["remedy"]) == ("warn", f"Rebuild them: slipstand recover {runs}")
    assert sorted(path.name for path in runs.iterdir()) == [f"cut{SUFFIX}"]


@pytest.mark.parametrize(
    ("valid_until", "state", "said"),
    [
        (None, "ok", "no last day is stated"),
        (datetime.date(2020, 1, 31), "warn", "valid until 2020-01-31, which is past"),
        (datetime.date.max, "ok", "valid until 9999-12-31"),
    ],
)
def test_a_calibration_that_has_expired_is_a_warning(
    slipstand: Any, own_folders: Path, valid_until: datetime.date | None, state: str, said: str
) -> None:
    use_table(own_folders, valid_until=valid_until)
    check = found(slipstand("doctor", "--json"))["calibration of gauge 1"]
    assert check["state"] == state
    assert said in check["message"]


def test_a_calibration_that_soon_expires_is_a_warning() -> None:
    gauge = load_gauges().table.replace(valid_until=datetime.date(2026, 3, 1))
    assert check_calibration("gauge 1", gauge, datetime.date(2026, 1, 29)).state is FindingState.OK
    soon = check_calibration("gauge 1", gauge, datetime.date(2026, 2, 20))
    assert (soon.state, soon.message[-9:]) == (FindingState.WARN, "in 9 days")


def test_checks_of_gauges_are_told(slipstand: Any, own_folders: Path) -> None:
    use_table(own_folders)
    gauge = load_gauges().table
    noon = datetime.datetime(2026, 11, 21, 12, tzinfo=datetime.UTC)
    facts = (0.010, 0.010_080, 3e-5, gauge.gain_m_per_count, (), gauge.serial_number)
    append_check(GaugeCheck("table", noon, False, *facts))
    checks = found(slipstand("doctor", "--json"))
    assert checks["check of gauge 1"]["state"] == "warn"
    assert (
        checks["check of gauge 1"]["message"] == "failed on 2026-11-21 12:00: +80 um at 10 mm, 30 um allowed"
    )
    assert "not checked yet" in checks["check of gauge 2"]["message"]

    checks_path().write_text("[[check]\n")
    outcome = slipstand("doctor", "--json")
    assert outcome.code == 1
    assert found(outcome)["gauge checks"]["state"] == "fail"


@pytest.mark.usefixtures("unhurried")
def test_effects_of_the_stand_over_its_last_runs_are_told(
    slipstand: Any, real_stand_runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(real_stand_runs))
    checks = found(slipstand("doctor", "--json"))
    mode, ramp = checks["second-mode"], checks["release-ramp"]

    assert checks["effects of the stand"]["message"] == (
        "3 kept results of the last 3 run files (at most 20 are read), 3 of them searched for effects"
    )
    assert (mode["state"], ramp["state"]) == ("warn", "ok")
    assert mode["message"].startswith("3 of 3 runs: a second mode at ")
    assert mode["remedy"].endswith(f"slipstand table {real_stand_runs}")
    assert ramp["message"].startswith("1 of 3 runs (20261121T100000_1FFM0_001.h5): the release took")


def test_without_kept_results_effects_of_the_stand_are_not_claimed_to_be_none(slipstand: Any) -> None:
    check = found(slipstand("doctor", "--json"))["effects of the stand"]

    assert check["state"] == "ok"
    assert "none of this stand; analyze --save keeps them" in check["message"]


def use_table(folder: Path, **changes: Any) -> None:
    """Make a calibration of gauge 1 the one in use."""
    base = settings_file("gauges.toml")
    table = load_gauges(base).table.replace(**changes)
    save_calibration({"table": table}, base, datetime.date(2020, 1, 1), folder / "settings" / "gauges.toml")


def test_a_check_that_breaks_down_does_not_hide_the_others(
    slipstand: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> list[PortInfo]:
        raise OSError("no such\nsubsystem")

    monkeypatch.setattr(ports, "list_ports", broken)
    outcome = slipstand("doctor", "--json")
    assert outcome.code == 1
    checks = found(outcome)
    assert checks["ports"]["message"] == "cannot be checked (OSError: no such subsystem)"
    assert checks["clock"]["state"] == "ok"


def test_a_library_that_is_missing_fails_and_the_rest_is_checked(
    slipstand: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(installation._NEEDED, "h5py", "no_such_module")
    monkeypatch.setitem(installation._OF_WINDOW, "pyqtgraph", "no_such_module_either")
    checks = found(slipstand("doctor", "--json"))
    assert (checks["libraries"]["state"], checks["window"]["state"]) == ("fail", "warn")
    assert checks["libraries"]["message"] == "h5py cannot be found"
    assert checks["date"]["state"] == "ok"


def test_what_stands_in_the_way_of_a_port_is_told_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    hints = [PortHint("it is slow", "Make it quicker"), PortHint("it is forbidden", "Ask", rule_helps=True)]
    slow, forbidden = ports.check_port(FTDI, hints)
    assert slow.state is forbidden.state is FindingState.WARN
    assert slow.message == "FTDI FT232R adapter: it is slow"
    assert slow.remedy == "Make it quicker"
    assert "/etc/udev/rules.d/ && sudo udevadm control --reload" in forbidden.remedy
    assert "60-slipstand.rules" in forbidden.remedy
    assert Path(shlex.split(forbidden.remedy.partition("sudo cp ")[2])[0]).is_file()
    (well,) = ports.check_port(FTDI, [])
    assert well.state is FindingState.OK
    monkeypatch.setattr(ports, "other_port_users", lambda _: [PortUser(7, "screen")])
    (held,) = ports.check_port(FTDI, [])
    assert held.message == "FTDI FT232R adapter, in use by screen (process 7)"


@pytest.mark.parametrize(("runs", "state"), [(False, FindingState.OK), (True, FindingState.WARN)])
def test_modem_manager_is_noticed(monkeypatch: pytest.MonkeyPatch, runs: bool, state: FindingState) -> None:
    monkeypatch.setattr(ports, "modem_manager_runs", lambda: runs)
    told = {finding.subject: finding for finding in ports.check_ports()}
    assert told["other programs"].state is state


def test_what_was_never_tried_on_hardware_is_said() -> None:
    said = ports.check_protocols().message
    assert said.startswith("not verified on hardware: slipstand-binary, csv, gsv")


@pytest.mark.parametrize(
    ("free", "state"),
    [
        (10**10, FindingState.OK),
        (10**9, FindingState.WARN),
        (10**7, FindingState.FAIL),
        (None, FindingState.WARN),
    ],
)
def test_room(free: int | None, state: FindingState) -> None:
    assert folders.check_disk_space(free).state is state


@pytest.mark.parametrize(
    ("reads_ns", "state"),
    [
        ([0, 50, 50, 100], FindingState.OK),
        ([0, 16_000_000, 32_000_000], FindingState.WARN),
        ([5, 5, 5], FindingState.WARN),
        ([5, 4, 6], FindingState.WARN),
    ],
)
def test_resolution_of_the_clock(reads_ns: list[int], state: FindingState) -> None:
    assert installation.check_resolution(reads_ns).state is state


def test_a_date_before_the_program_is_wrong() -> None:
    program = datetime.datetime(2026, 5, 1, tzinfo=datetime.UTC)
    assert installation.check_date(program + datetime.timedelta(hours=1), program).state is FindingState.OK
    assert (
        installation.check_date(datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC), program).state
        is FindingState.WARN
    )


def test_where_compiled_code_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    assert "beside the code" in installation.check_compiled_code(tmp_path).message
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    assert str(tmp_path / "cache") in installation.check_compiled_code(tmp_path).message
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    assert installation.check_compiled_code(tmp_path).state is FindingState.WARN
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert "minutes" in installation.check_compiled_code(tmp_path).message


def test_code_is_compiled_before_anything_is_checked(slipstand: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    monkeypatch.setattr(compilation, "compile_all", lambda: done.append("compiled"))
    slipstand("doctor", "--json")
    assert done == []
    slipstand("doctor", "--compile", "--json")
    assert done == ["compiled"]


def test_a_bundle_holds_what_a_bug_report_needs_and_says_so(
    slipstand: Any, own_folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPSTAND_LOGS", str(own_folders / "logs"))
    (own_folders / "settings" / "settings.toml").write_text('theme = "dark"\n')
    (own_folders / "logs").mkdir()
    (own_folders / "logs" / "engine.log").write_text("lost the port\n")
    target = own_folders / "report.zip"
    outcome = slipstand("doctor", "--bundle", target)
    with zipfile.ZipFile(target) as bundle:
        names = set(bundle.namelist())
        assert {"findings.json", "versions.json", "ports.json", "settings/settings.toml"} <= names
        assert bundle.read("log/engine.log") == b"lost the port\n"
        readme = bundle.read("README.txt").decode()
        subjects = {finding["subject"] for finding in json.loads(bundle.read("findings.json"))}
    assert {"slipstand", "recordings", "gauges.toml"} <= subjects
    for name in names - {"README.txt"}:
        assert f"{name}: " in readme
        assert f"{name}: " in outcome.err
    assert slipstand("doctor", "--bundle", target).code == 1, "nothing is overwritten without --force"


def test_a_bundle_is_made_of_an_installation_that_is_damaged(
    slipstand: Any, own_folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An upgrade that failed leaves a package without its facts."""
    (own_folders / "lost-1.0.dist-info").mkdir()
    (own_folders / "whole-2.0.dist-info").mkdir()
    (own_folders / "whole-2.0.dist-info" / "METADATA").write_text("Name: whole\nVersion: 2.0\n")
    monkeypatch.syspath_prepend(str(own_folders))
    target = own_folders / "report.zip"
    assert slipstand("doctor", "--bundle", target).code == 0
    with zipfile.ZipFile(target) as bundle:
        libraries = json.loads(bundle.read("versions.json"))["libraries"]
    assert (libraries["whole"], "lost" in libraries, "null" in libraries) == ("2.0", False, False)


def test_what_killed_programs_left_among_the_runs_is_said(slipstand: Any, own_folders: Path) -> None:
    runs = own_folders / "runs"
    (runs / "below").mkdir(parents=True)
    left = [runs / ".run.h5.4711.tmp", runs / "below" / ".other.0123abcd.h5"]
    for path in (*left, runs / ".young.h5.4712.tmp", runs / ".hidden.h5"):
        path.write_bytes(b"copy")
    for path in (*left, runs / ".hidden.h5"):
        os.utime(path, (0, 0))
    outcome = slipstand("doctor", "--json")
    assert outcome.code == 0
    check = found(outcome)["leftovers"]
    assert check["state"] == "warn"
    assert check["message"].startswith("2 temporary files of killed programs, 0.0 MB")
    assert check["remedy"] == f"Delete them: {left[0]}, {left[1]}"
