"""`slipstand calibrate`, from a file and from a device that the test moves."""

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_kit import GAIN, RATE_HZ, Bench, counts_of
from cli_kit import assert_one_error_line

from app.acquisition.messages import RunSettings
from app.cli.record import check_recording
from config.files import load_gauges, save_calibration, settings_file
from config.schema import Filter

MARKS_MM = [0.0, 3.0, 6.0, 9.0, 12.0]
ROUND_MM = MARKS_MM + MARKS_MM[-2::-1]


@pytest.fixture(autouse=True)
def config_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "settings"
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(folder))
    return folder


@pytest.fixture
def points(tmp_path: Path) -> Path:
    """Two rounds of a gauge with 4 um of hysteresis."""
    places = ROUND_MM + ROUND_MM[1:]
    ways = np.sign(np.diff(places, prepend=-1.0))
    path = tmp_path / "points.csv"
    lines = [f"{float(counts_of(mm + 0.002 * way))!r},{mm}" for mm, way in zip(places, ways, strict=True)]
    path.write_text("counts,dial_mm\n" + "\n".join(lines) + "\n")
    return path


def test_a_file_of_readings_becomes_a_calibration(
    slipstand: Any, points: Path, config_folder: Path, tmp_path: Path
) -> None:
    about = [
        "--by",
        "Ada",
        "--certificate",
        "DKD 7",
        "--valid-until",
        "2030-06-30",
        "--dial-uncertainty",
        0.002,
    ]
    figure = tmp_path / "residuals.png"
    outcome = slipstand(
        "calibrate", "--gauge", "table", "--points", points, *about, "--figure", figure, "--json"
    )

    assert outcome.code == 0, outcome.err
    document = outcome.json
    assert document["gain_m_per_count"]["value"] == pytest.approx(GAIN, rel=1e-3)
    assert document["hysteresis_m"] == pytest.approx(4e-6, rel=1e-3)
    assert document["warnings"] == []
    assert len(document["readings"]) == 17
    assert figure.stat().st_size > 10_000
    path = Path(document["file"])
    assert path.parent == config_folder
    gauge = load_gauges(path).table
    assert gauge.gain_m_per_count == document["gain_m_per_count"]["value"]
    low, high = document["gain_m_per_count"]["interval_95"]
    half = 1.96 * gauge.gain_relative_standard_uncertainty * abs(gauge.gain_m_per_count)
    assert half == pytest.approx((high - low) / 2, rel=1e-4)
    assert (gauge.calibrated_by, gauge.certificate, str(gauge.valid_until)) == ("Ada", "DKD 7", "2030-06-30")
    shipped = load_gauges()
    assert (gauge.delay_standard_uncertainty_s, gauge.range_m) == (
        shipped.table.delay_standard_uncertainty_s, shipped.table.range_m
    )  # fmt: skip
    assert load_gauges(path).relative == shipped.relative


def test_both_gauges_one_after_the_other_end_up_in_use(
    slipstand: Any, points: Path, config_folder: Path
) -> None:
    first = slipstand("calibrate", "--gauge", "table", "--points", points, "--use", "--json").json
    second = slipstand("calibrate", "--gauge", "relative", "--points", points, "--use", "--json").json

    assert first["kept"] is None
    assert Path(second["kept"]).is_file()
    gauges = load_gauges()
    assert gauges.table.gain_m_per_count == pytest.approx(GAIN, rel=1e-3)
    assert gauges.relative.gain_m_per_count == pytest.approx(GAIN, rel=1e-3)
    assert len(list(config_folder.glob("*.toml"))) == 4


def test_a_gauge_keeps_its_serial_number_but_not_that_of_the_simulated_stand(
    slipstand: Any, points: Path
) -> None:
    calibrate = ("calibrate", "--gauge", "table", "--points", points, "--use")
    assert load_gauges().table.serial_number == "SIM-1"
    slipstand(*calibrate)
    assert load_gauges().table.serial_number == ""
    assert load_gauges().relative.serial_number == "SIM-2"
    slipstand(*calibrate, "--serial-number", "W7")
    slipstand(*calibrate)
    assert load_gauges().table.serial_number == "W7"


def test_a_stated_filter_is_kept_until_another_is_stated(slipstand: Any, points: Path) -> None:
    calibrate = ("calibrate", "--gauge", "relative", "--points", points, "--use")
    stated = slipstand(*calibrate, "--filter", "bessel", "--filter-order", 4, "--filter-corner", 50, "--json")
    assert stated.json["filter"] == {
        "kind": "bessel", "order": 4, "corner_hz": 50.0, "corner_relative_standard_uncertainty": 0.05
    }  # fmt: skip
    assert "filter         Bessel, order 4, 50 Hz" in slipstand(*calibrate).out
    assert slipstand(*calibrate, "--filter", "none", "--json").json["filter"]["kind"] == "none"
    assert load_gauges().relative.filter == Filter("none")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--filter", "notch"), "--filter 'notch' is not known. Use none, rc, butterworth, bessel or sinc"),
        (("--filter", "rc"), "corner_hz = None and kind = 'rc': a filter has a corner"),
        (("--filter-corner", 50), "--filter-corner needs --filter"),
    ],
)
def test_a_filter_that_cannot_be_is_refused(slipstand: Any, points: Path, given: Any, said: str) -> None:
    outcome = slipstand("calibrate", "--gauge", "table", "--points", points, *given)
    assert_one_error_line(outcome, said)


def test_people_read_residuals_uncertainty_and_what_to_do_next(slipstand: Any, points: Path) -> None:
    outcome = slipstand("calibrate", "--gauge", "relative", "--points", points, "--degree", 2)
    assert outcome.code == 0, outcome.err
    for words in (
        "residual (µm)",
        "hysteresis     4.0 µm",
        "polynomial ",
        "standard uncertainty",
        "warning dial-uncertainty-not-stated",
        "slipstand record --calibration ",
    ):
        assert words in outcome.out
    assert outcome.out.count(" down ") == 8


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_run_reads_counts_as_they_were_calibrated(slipstand: Any, points: Path, degree: int) -> None:
    document = slipstand(
        "calibrate", "--gauge", "table", "--points", points, "--degree", degree, "--json"
    ).json
    gauge = load_gauges(document["file"]).table
    assert len(gauge.polynomial) == degree - 1
    counts = np.array([row["counts"] for row in document["readings"]])
    shown_m = [row["dial_m"] - row["residual_m"] for row in document["readings"]]
    np.testing.assert_allclose(gauge.displacement_m(counts), shown_m, atol=1e-12)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_other_separators_and_stated_directions_are_read(
    slipstand: Any, tmp_path: Path, separator: str
) -> None:
    rows = [(counts_of(mm), mm, "up", 1) for mm in MARKS_MM] + [
        (counts_of(mm), mm, "up", 2) for mm in MARKS_MM
    ]
    lines = [separator.join(map(str, row)).replace(".", ",") for row in rows]
    path = tmp_path / "points.csv"
    path.write_text(separator.join(("Counts", "dial_mm", "direction", "round")) + "\n" + "\n".join(lines))
    document = slipstand("calibrate", "--gauge", "table", "--points", path, "--json").json
    assert document["gain_m_per_count"]["value"] == pytest.approx(GAIN, rel=1e-9)
    assert {row["round"] for row in document["readings"]} == {1, 2}
    assert "one-way-only" in [warning["code"] for warning in document["warnings"]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "there is no column counts"),
        ("counts,mm\n1,2\n", "there is no column dial_mm"),
        ("counts,dial_mm\n1,0\n2,x\n", "line 3: dial_mm 'x' is not a number"),
        ("counts,dial_mm\n1,0\n2\n", "line 3: dial_mm '' is not a number"),
        ("counts,dial_mm,direction,round\n1,0,left,1\n", "line 2: direction 'left' is not known"),
        ("counts,dial_mm\n1,0\n2,1\n", "2 steps are too few"),
        ("counts,dial_mm\n1,0\n2,1\n1.5,2\n4,3\n", "reading 3: counts go from 2 to 1.5"),
        ("counts,dial_mm\n1,0\n1,1\n1,2\n", "all 3 counts are 1"),
    ],
)
def test_readings_that_make_no_calibration(
    slipstand: Any, tmp_path: Path, config_folder: Path, text: str, said: str
) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text)
    assert_one_error_line(slipstand("calibrate", "--gauge", "table", "--points", path), said)
    assert not config_folder.exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--gauge", "third"), "--gauge 'third' is not known"),
        (("--gauge", "table"), "--points FILE, or a device"),
        (("--gauge", "table", "--port", "loop://"), "--port loop:// needs --protocol"),
        (("--gauge", "table", "--points", "no.csv"), "no.csv: cannot be read"),
        (("--gauge", "table", "--points", "no.csv", "--degree", 5), "--degree 5 is not offered"),
        (("--gauge", "table", "--points", "no.csv", "--dial-uncertainty", -1), "--dial-uncertainty -1"),
        (
            ("--gauge", "table", "--points", "no.csv", "--figure", "a.bmp"),
            "--figure a.bmp has no known ending",
        ),
        (("--gauge", "table", "--points", "no.csv", "--valid-until", "2020-01-31"), "2020-01-31 is past"),
        (("--gauge", "table", "--points", "no.csv", "-o", "a.txt"), "-o a.txt has no known ending"),
    ],
)
def test_what_cannot_be_is_refused(slipstand: Any, arguments: tuple[Any, ...], said: str) -> None:
    assert_one_error_line(slipstand("calibrate", *arguments), said)


def test_record_says_that_a_calibration_has_expired(
    config_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    base = settings_file("gauges.toml")
    expired = load_gauges(base).relative.replace(valid_until=datetime.date(2020, 1, 31))
    path = save_calibration({"relative": expired}, base, datetime.date(2020, 1, 1))
    check_recording(RunSettings(directory=str(tmp_path), series="1FFM0"), path)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: the calibration of gauge 2 (relative) was valid until 2020-01-31")
    check_recording(RunSettings(directory=str(tmp_path), series="1FFM0"), base)
    assert capsys.readouterr().err == ""


@pytest.fixture
def bench(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    bench = Bench(request.param)
    monkeypatch.setattr("sys.stdin", bench)
    yield bench
    bench.close()


def live(bench: Bench) -> tuple[Any, ...]:
    device = ("--port", bench.port, "--protocol", "csv", "--set", "columns=table,relative", "--rate", RATE_HZ)
    return ("calibrate", "--gauge", "relative", *device, "--settle", 0.15, "--json")


@pytest.mark.parametrize(
    "bench", [["0", "3", "7", "undo", "oops", "6,0", "9", "12", "9", "6", "3", "0", ""]], indirect=True
)
def test_a_device_is_calibrated_live(slipstand: Any, bench: Bench, config_folder: Path) -> None:
    outcome = slipstand(*live(bench))

    assert outcome.code == 0, outcome.err
    document = outcome.json
    assert document["gain_m_per_count"]["value"] == pytest.approx(GAIN, rel=2e-3)
    assert [row["dial_m"] for row in document["readings"]] == pytest.approx([mm * 1e-3 for mm in ROUND_MM])
    assert "7 mm taken back" in outcome.err
    assert "'oops' is not a number" in outcome.err
    (kept,) = config_folder.glob("readings-relative-*.csv")
    again = slipstand("calibrate", "--gauge", "relative", "--points", kept, "--json").json
    assert again["gain_m_per_count"] == document["gain_m_per_count"]


@pytest.mark.parametrize("bench", [["0", "3", "3", ""]], indirect=True)
def test_readings_that_fail_are_kept(slipstand: Any, bench: Bench, config_folder: Path) -> None:
    outcome = slipstand(*live(bench))
    assert outcome.code == 1
    assert "error: reading 3: the dial stays at 3 mm" in outcome.err
    (kept,) = config_folder.glob("readings-relative-*.csv")
    assert str(kept) in outcome.err
    assert len(kept.read_text().splitlines()) == 4
    assert not list(config_folder.glob("*.toml"))
