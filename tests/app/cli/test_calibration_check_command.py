"""`slipstand calibrate check` against a device that the test moves; runs carry its result."""

import datetime
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from bench_kit import GAIN, RATE_HZ, ZERO, Bench
from cli_kit import assert_one_error_line

from app.acquisition.messages import RunSettings
from app.acquisition.run_setup import build_metadata
from app.cli.record import check_recording
from app.runs.analysis_json import gauge_check_warnings
from config.files import checks_path, load_checks, load_gauges, load_stand, save_calibration, settings_file
from drivers.samples import DeviceIdentity

CLAIM = {"gain_relative_standard_uncertainty": 0.002, "nonlinearity_m": 2e-6}


@pytest.fixture
def gauges_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A calibration of the bench's gauge 2."""
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "settings"))
    base = settings_file("gauges.toml")
    gauge = load_gauges(base).relative.replace(gain_m_per_count=GAIN, zero_count=ZERO, **CLAIM)
    return save_calibration({"relative": gauge}, base, datetime.date(2026, 1, 12))


@pytest.fixture
def bench(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """Rests 3 mm off its zero; where Enter is asked for, a place is typed, to which it moves before."""
    bench = Bench(["3", request.param[0], ""], gain_error=request.param[1])
    monkeypatch.setattr("sys.stdin", bench)
    yield bench
    bench.close()


def arguments(bench: Bench, gauges_file: Path, *known: object) -> tuple[object, ...]:
    device = ("--port", bench.port, "--protocol", "csv", "--set", "columns=table,relative", "--rate", RATE_HZ)
    about = ("--calibration", gauges_file, "--seconds", 0.2, "--by", "Ada", "--reference", "block 6")
    return ("calibrate", "check", "--gauge", "relative", *device, *about, *known)


@pytest.mark.parametrize("bench", [("9", 0.0)], indirect=True)
def test_a_sound_gauge_passes_wherever_it_rests(slipstand: Any, bench: Bench, gauges_file: Path) -> None:
    known = ("--displacement", 6, "--uncertainty", 0.001, "--json")
    outcome = slipstand(*arguments(bench, gauges_file, *known))

    assert outcome.code == 0, outcome.err
    found = outcome.json
    assert found["passed"] is True
    assert found["measured_m"] == pytest.approx(0.006, abs=2e-6)
    assert found["tolerance_m"] == pytest.approx(2 * (12e-6**2 + 1e-6**2 + 2 * 2e-6**2 / 3) ** 0.5, rel=0.01)
    (kept,) = load_checks().check
    assert (kept.passed, kept.checked_by, kept.reference) == (True, "Ada", "block 6")
    assert kept.deviation_m == pytest.approx(found["deviation_m"])


@pytest.mark.parametrize("bench", [("9", 0.02)], indirect=True)
def test_a_gauge_that_changed_by_2_percent_fails_and_later_runs_say_so(
    slipstand: Any, bench: Bench, gauges_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcome = slipstand(*arguments(bench, gauges_file, "--displacement", 6))

    assert outcome.code == 1
    assert outcome.out.startswith("FAIL  gauge 2 (relative)")
    assert "deviation  +0.12" in outcome.out
    assert "warning not-stated: the uncertainty of the known displacement" in outcome.out
    assert outcome.err.count("then press Enter") == 2

    gauges = load_gauges(gauges_file)
    stream = SimpleNamespace(
        identity=DeviceIdentity("csv", ""), port_identity="", rate_hz=400.0, filters=(None, None)
    )
    run = build_metadata(RunSettings("/runs", series="1FFM0"), load_stand(), gauges, stream)  # type: ignore[arg-type]
    (check,) = run.gauge_checks
    assert not check.passed
    (caution,) = gauge_check_warnings(run.gauge_checks)
    assert caution.code == "gauge-check-failed"
    assert "gauge 2 (relative) was +12" in str(caution.message)
    assert "at 6 mm" in str(caution.message)

    check_recording(RunSettings(str(tmp_path), series="1FFM0"), gauges_file)
    assert "warning: gauge 2 (relative) was +12" in capsys.readouterr().err


@pytest.mark.parametrize("bench", [("5", 0.0)], indirect=True)
def test_a_shunt_is_known_by_its_counts(slipstand: Any, bench: Bench, gauges_file: Path) -> None:
    shift = 2e-3 / GAIN
    outcome = slipstand(*arguments(bench, gauges_file, "--shunt-counts", shift, "--uncertainty", 1, "--json"))
    assert outcome.code == 0, outcome.err
    assert outcome.json["expected_m"] == pytest.approx(2e-3)
    assert {line["source"] for line in outcome.json["budget"]} == {
        "gain of the calibration", "known displacement", "readings"
    }  # fmt: skip
    assert load_checks().check[0].kind == "shunt"
    assert "Switch the shunt on" in outcome.err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "give one of --displacement, --shunt and --shunt-counts"),
        (("--displacement", 6, "--shunt", 1), "give one of --displacement"),
        (("--displacement", 0), "--displacement 0 checks nothing"),
        (("--shunt", "nan"), "--shunt nan checks nothing"),
        (("--displacement", 6, "--seconds", 0), "--seconds 0 must be"),
        (("--displacement", 6, "--uncertainty", -1), "--uncertainty -1 must be"),
        (("--displacement", 6, "--parity", "X"), "--parity 'X' is not known"),
    ],
)
def test_what_checks_nothing_is_refused(
    slipstand: Any, gauges_file: Path, options: tuple[Any, ...], said: str
) -> None:
    device = ("--port", "loop://", "--protocol", "csv")
    assert_one_error_line(slipstand("calibrate", "check", "--gauge", "table", *device, *options), said)
    assert not checks_path().exists()


def test_a_broken_history_is_told_before_anything_is_opened(slipstand: Any, gauges_file: Path) -> None:
    checks_path().write_text("[[check]\n")
    outcome = slipstand(
        "calibrate", "check", "--gauge", "table", "--port", "loop://", "--protocol", "csv", "--shunt", 1
    )
    assert_one_error_line(outcome, "gauge-checks.toml: is not valid TOML")


@pytest.mark.parametrize("bench", [("3", 0.0)], indirect=True)
def test_a_gauge_that_was_not_moved_keeps_no_check(slipstand: Any, bench: Bench, gauges_file: Path) -> None:
    outcome = slipstand(*arguments(bench, gauges_file, "--displacement", 6))
    assert outcome.code == 1
    assert "error: the gauge shows" in outcome.err
    assert "mm of +6 mm: it was not moved, or it does not read. Nothing is kept" in outcome.err
    assert not checks_path().exists()
