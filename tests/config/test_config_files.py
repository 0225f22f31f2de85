"""Settings files: the shipped ones are valid, and an invalid one is explained in one line."""

import datetime
from pathlib import Path

import numpy as np
import pytest

from config.files import (
    activate_calibration,
    load_gauges,
    load_stand,
    published_row,
    published_table,
    save_calibration,
    settings_file,
)
from config.schema import ConfigError, Filter, SeriesError

GAUGE = "[{name}]\ngain_m_per_count = {gain}\nzero_count = 0\n"


def write_gauges(folder: Path, table: str = "1e-9", extra: str = "") -> Path:
    """Write a calibration file whose table gain and extra lines are given."""
    path = folder / "gauges.toml"
    path.write_text(
        GAUGE.format(name="table", gain=table) + extra + GAUGE.format(name="relative", gain="1e-9")
    )
    return path


def test_the_shipped_stand_is_the_papers() -> None:
    stand = load_stand()
    assert (stand.table_mass_kg, stand.plate_mass_kg) == (131.6, 22.4)
    assert list(stand.pullbacks_m.values()) == [0.012, 0.009, 0.006]


def test_the_series_of_a_stand_are_all_that_its_alphabets_make() -> None:
    stand = load_stand()
    assert stand.all_series == tuple(published_table())
    smaller = stand.replace(pullbacks_m={"4": 0.003}, added_masses_kg={"M0": 0.0, "M9": 1.0})
    assert smaller.all_series == tuple(
        f"4{contact}{mass}" for contact in stand.contacts for mass in ("M0", "M9")
    )
    assert all(smaller.series(code).code == code for code in smaller.all_series)


def test_the_shipped_gauges_cover_the_largest_pullback() -> None:
    gauges = load_gauges()
    assert gauges.table.range_m is not None
    assert gauges.table.range_m > 0.012


def test_every_row_of_table_1_is_a_series_of_the_stand() -> None:
    stand = load_stand()
    table = published_table()
    assert len(table) == 36
    for code, row in table.items():
        series = stand.series(code)
        assert series.code == code
        assert series.plate_mass_kg == pytest.approx(row.plate_mass_kg)


@pytest.mark.parametrize(
    ("code", "pullback_m", "contact", "plate_mass_kg"),
    [("1FFM0", 0.012, "FF", 22.4), ("3SSLM2", 0.006, "SSL", 32.4), (" 2ssm3 ", 0.009, "SS", 42.4)],
)
def test_series_code(code: str, pullback_m: float, contact: str, plate_mass_kg: float) -> None:
    series = load_stand().series(code)
    assert (series.pullback_m, series.contact, series.plate_mass_kg) == (pullback_m, contact, plate_mass_kg)


@pytest.mark.parametrize("code", ["", "4FFM0", "1XXM0", "1FFM9", "1FF", "FFM0", "1FFM0 extra"])
def test_a_wrong_series_code_says_what_is_allowed(code: str) -> None:
    with pytest.raises(SeriesError, match=r"pullback \(1, 2, 3\), contact \(FF, SS, SSL\)"):
        load_stand().series(code)


def test_a_series_that_the_paper_did_not_run_is_named() -> None:
    with pytest.raises(ConfigError, match="1FFM7"):
        published_row("1FFM7")


@pytest.mark.parametrize(
    ("table_gain", "extra", "said"),
    [
        ("0.0", "", r"table: gain_m_per_count = 0\.0 must be finite and not 0"),
        ("inf", "", r"gain_m_per_count = inf"),
        ("nan", "", r"gain_m_per_count = nan"),
        ("'a'", "", r"table\.gain_m_per_count = 'a': Expected `float`, got `str`"),
        ("1e-9", "range = 3\n", r"unknown field `range`"),
        ("1e-9", "range_m = -0.1\n", r"range_m = -0\.1 must be a finite number above 0"),
        ("1e-9", "nonlinearity_m = -1.0\n", r"nonlinearity_m = -1\.0"),
        ("1e-9", "measures = 'speed'\n", r"measures = 'speed'"),
        ("1e-9", "date = 'soon'\n", r"date = 'soon'"),
    ],
)
def test_a_wrong_calibration_names_file_key_and_value(
    tmp_path: Path, table_gain: str, extra: str, said: str
) -> None:
    path = write_gauges(tmp_path, table_gain, extra)
    with pytest.raises(ConfigError, match=said) as raised:
        load_gauges(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_negative_gain_is_a_gauge_mounted_the_other_way(tmp_path: Path) -> None:
    assert load_gauges(write_gauges(tmp_path, "-1e-9")).table.gain_m_per_count == -1e-9


@pytest.mark.parametrize("content", [None, b"\xff\xfe", b"[table\n", b""])
def test_an_unusable_file_is_one_line(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "gauges.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError) as raised:
        load_gauges(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_the_labs_own_settings_come_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path))
    assert settings_file("gauges.toml").parent != tmp_path
    own = write_gauges(tmp_path)
    assert settings_file("gauges.toml") == own


def test_settings_are_immutable_and_checked_when_replaced() -> None:
    stand = load_stand()
    with pytest.raises(AttributeError):
        stand.table_mass_kg = 1.0  # type: ignore[misc]
    with pytest.raises(ValueError, match="table_mass_kg"):
        stand.replace(table_mass_kg=-1.0)


DAY = datetime.date(2026, 1, 12)


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path))
    return tmp_path


def test_a_new_calibration_keeps_comments_device_and_the_other_gauge(own_folder: Path) -> None:
    base = settings_file("gauges.toml")
    before = load_gauges(base)
    new = before.table.replace(
        gain_m_per_count=-3.25e-9,
        polynomial=(-1.5, 20.0),
        hysteresis_m=4e-6,
        nonlinearity_m=None,
        calibrated_by="A. Operator",
        valid_until=datetime.date(2027, 1, 12),
        filter=Filter("bessel", 4, 50.0),
    )
    path = save_calibration({"table": new}, base, DAY)

    assert path == own_folder / "gauges-2026-01-12.toml"
    assert load_gauges(path) == before.replace(table=new)
    assert "# Gauge 1: shaking table against the fixed base." in path.read_text()
    assert "nonlinearity_m" not in path.read_text().partition("[relative]")[0]


def test_comments_stay_at_what_they_are_about(own_folder: Path) -> None:
    base = settings_file("gauges.toml")
    table = load_gauges(base).table.replace(serial_number="W7", calibrated_by="A. Operator")
    text = save_calibration({"table": table}, base, DAY).read_text()

    of_table, _, of_relative = text.partition("# Gauge 2: upper plate against the box.\n")
    assert of_relative.startswith("[relative]\n")
    assert of_table.endswith('calibrated_by = "A. Operator"\n\n')
    assert 'serial_number = "W7"\n' in of_table
    assert "simulated" not in of_table
    assert 'serial_number = "SIM-2"  # of the simulated stand' in of_relative


def test_calibrations_of_a_day_stand_beside_each_other(own_folder: Path) -> None:
    base = settings_file("gauges.toml")
    table = load_gauges(base).table
    names = [save_calibration({"table": table}, base, DAY).name for _ in range(3)]
    assert names == ["gauges-2026-01-12.toml", "gauges-2026-01-12-2.toml", "gauges-2026-01-12-3.toml"]
    with pytest.raises(ConfigError, match="exists already and is not overwritten"):
        save_calibration({"table": table}, base, DAY, own_folder / names[0])


def test_the_calibration_in_use_is_kept_when_another_takes_its_place(own_folder: Path) -> None:
    base = settings_file("gauges.toml")
    tables = [load_gauges(base).table.replace(zero_count=float(zero)) for zero in (1, 2)]
    first, second = (save_calibration({"table": table}, base, DAY) for table in tables)

    assert activate_calibration(first, DAY) is None
    kept = activate_calibration(second, DAY)
    assert load_gauges().table == tables[1]
    assert kept == own_folder / "gauges-until-2026-01-12.toml"
    assert load_gauges(kept).table == tables[0]
    assert not list(own_folder.glob("*.new"))


def test_a_file_that_cannot_be_a_calibration_does_not_take_its_place(own_folder: Path) -> None:
    wrong = own_folder / "wrong.toml"
    wrong.write_text("[table]\n")
    with pytest.raises(ConfigError):
        activate_calibration(wrong, DAY)
    assert not (own_folder / "gauges.toml").exists()


def test_counts_become_displacements_by_the_polynomial() -> None:
    gauge = load_gauges().table.replace(gain_m_per_count=2e-9, zero_count=100.0, polynomial=(3.0, -40.0))
    x = 2e-9 * (np.array([0.0, 100.0, 2e6, -3e6]) - 100.0)
    np.testing.assert_allclose(
        gauge.displacement_m(np.array([0.0, 100.0, 2e6, -3e6])), x + 3.0 * x**2 - 40.0 * x**3, rtol=1e-14
    )


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("polynomial = [1.0, 2.0, 3.0]", "polynomial has 3 terms, 2 at most"),
        ("polynomial = [nan]", "polynomial = nan must be a finite number"),
        ("polynomial = 3.0", "table.polynomial = 3.0: Expected `array`"),
        ("hysteresis_m = -1e-6", "hysteresis_m = -1e-06 must be"),
    ],
)
def test_a_wrong_bend_is_explained(tmp_path: Path, line: str, fault: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_gauges(write_gauges(tmp_path, extra=line + "\n"))
    assert fault in str(refused.value)


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("filter = {kind = 'rc'}", "corner_hz = None and kind = 'rc': a filter has a corner"),
        ("filter = {kind = 'none', corner_hz = 5.0}", "corner_hz = 5.0 and kind = 'none'"),
        ("filter = {kind = 'bessel', order = 9, corner_hz = 5.0}", "order = 9 must be from 1 to 8"),
        ("filter = {kind = 'bessel', corner_hz = -5.0}", "corner_hz = -5.0 must be a finite number above 0"),
        ("filter = {kind = 'notch', corner_hz = 5.0}", "table.filter.kind = 'notch'"),
    ],
)
def test_a_wrong_filter_is_explained(tmp_path: Path, line: str, fault: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_gauges(write_gauges(tmp_path, extra=line + "\n"))
    assert fault in str(refused.value)


def test_a_filter_is_described() -> None:
    assert str(Filter("bessel", 4, 50.0).description) == "Bessel, order 4, 50 Hz"
    assert str(Filter("none").description) == "none"


def test_a_calibration_holds_until_its_last_day() -> None:
    gauge = load_gauges().table.replace(valid_until=DAY)
    assert not gauge.is_expired(DAY)
    assert gauge.is_expired(DAY + datetime.timedelta(days=1))
    assert not load_gauges().table.replace(valid_until=None).is_expired(datetime.date.max)
