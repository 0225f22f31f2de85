"""The history of gauge checks: entries stay, and the newest valid one counts."""

import datetime
from pathlib import Path

import pytest

from config.files import append_check, checks_path, load_checks, load_gauges
from config.schema import ConfigError, Gauge, GaugeCheck

NOON = datetime.datetime(2026, 11, 21, 12, 0, tzinfo=datetime.timezone(datetime.timedelta(hours=1)))


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "not" / "yet"))
    return tmp_path / "not" / "yet"


def check_of(gauge: Gauge, name: str, hour: int, **changes: object) -> GaugeCheck:
    facts = {
        "gauge": name, "at": NOON.replace(hour=hour), "passed": True, "expected_m": 0.010,
        "measured_m": 0.010_013, "tolerance_m": 3e-5, "gain_m_per_count": gauge.gain_m_per_count,
        "polynomial": gauge.polynomial, "serial_number": gauge.serial_number,
    }  # fmt: skip
    return GaugeCheck(**{**facts, **changes})


def test_checks_are_added_and_read_back_as_they_were(own_folder: Path) -> None:
    bent = load_gauges().table.replace(polynomial=(-1.5, 20.0), serial_number='say "5"\n')
    first = check_of(bent, "table", 9, reference="gauge block № 3", checked_by="Ada", kind="shunt")
    second = check_of(load_gauges().relative, "relative", 10, passed=False)

    assert load_checks().check == ()
    assert append_check(first) == append_check(second) == checks_path() == own_folder / "gauge-checks.toml"
    assert load_checks().check == (first, second)
    assert first.deviation_m == pytest.approx(13e-6)


def test_the_last_check_of_the_present_calibration_is_the_one_that_holds() -> None:
    gauges = load_gauges()
    append_check(check_of(gauges.table, "table", 8))
    append_check(check_of(gauges.table, "table", 9, passed=False))
    append_check(check_of(gauges.table, "table", 10, gain_m_per_count=3e-9))

    checks = load_checks()
    assert [one.at.hour for one in checks.latest_checks(gauges)] == [9]
    assert checks.latest_checks(gauges.replace(table=gauges.table.replace(polynomial=(1.0,)))) == ()
    assert checks.latest_checks(gauges.replace(table=gauges.table.replace(serial_number="other"))) == ()
    tared = gauges.replace(table=gauges.table.replace(zero_count=5.0))
    assert len(checks.latest_checks(tared)) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[check]\n", "is not valid TOML"),
        ('[[check]]\ngauge = "third"\n', "check[0].gauge: Invalid enum value 'third'"),
        ('[[check]]\ngauge = "table"\nat = 2026-01-01T10:00:00\n', "check"),
        ("[other]\n", "other"),
    ],
)
def test_a_broken_history_is_neither_believed_nor_added_to(own_folder: Path, text: str, said: str) -> None:
    own_folder.mkdir(parents=True)
    checks_path().write_text(text)
    with pytest.raises(ConfigError) as refused:
        append_check(check_of(load_gauges().table, "table", 9))
    assert said in str(refused.value)
    assert str(checks_path()) in str(refused.value)
    assert checks_path().read_text() == text


def test_checks_that_cannot_be() -> None:
    with pytest.raises(ValueError, match="has no time zone"):
        check_of(load_gauges().table, "table", 9, at=datetime.datetime(2026, 1, 1))  # noqa: DTZ001
    with pytest.raises(ValueError, match="measured_m = nan"):
        check_of(load_gauges().table, "table", 9, measured_m=float("nan"))
