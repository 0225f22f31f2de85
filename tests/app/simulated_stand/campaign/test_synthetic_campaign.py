"""A synthetic campaign: its random values, its truth and its files."""

import datetime
from pathlib import Path

import msgspec
import numpy as np
import pytest

from app.runs.reader import load_counts, open_run
from app.simulated_stand.synthetic_campaign import (
    CampaignOptions,
    draw_errors,
    duration,
    plan_tests,
    series_parameters,
    write_test,
)
from config.files import load_gauges, load_stand, published_table
from config.schema import ConfigError

START = datetime.datetime(2026, 11, 21, 8, 0, tzinfo=datetime.UTC)
FEW = CampaignOptions(series=("1FFM0", "1SSM3"), repeats=2, rate_hz=200.0, duration_s=2.0)


def planned(options: CampaignOptions, folder: Path = Path("/nowhere")):
    return plan_tests(options, load_stand(), load_gauges(), folder, START)


def test_all_of_table_1_is_planned_and_slips():
    tests = planned(CampaignOptions())
    assert len(tests) == 108
    assert [test.series for test in tests[::3]] == list(published_table())
    assert len({test.path for test in tests}) == len({test.seed for test in tests}) == 108
    for test in tests[::3]:
        motion = test.parameters.simulate(5.0)
        assert motion.slip_end_s > 0.0


def test_breakaway_friction_is_the_printed_one_where_the_row_then_slips():
    truth = {test.series: test.truth for test in planned(CampaignOptions(repeats=1))}
    assert truth["1FFM0"]["friction_static"] == 0.2
    assert truth["1SSM3"]["friction_static"] == truth["1SSM3"]["friction_dynamic"] == 0.13


def test_errors_are_those_that_the_stand_states():
    stand, gauges = load_stand(), load_gauges()
    drawn = [draw_errors(stand, gauges, seed) for seed in range(400)]
    table = np.array([[*each.gains, each.table_mass_kg, each.plate_mass_kg, each.lag_s] for each in drawn])
    stated = [0.003, 0.003, 0.3, 0.02, 2e-5 * 2**0.5]
    # The standard deviation of 400 draws is within 12 % of the true one in 999 of 1000 cases.
    assert table.std(axis=0) == pytest.approx(stated, rel=0.12)
    assert abs(table.mean(axis=0) / stated).max() < 0.2


def test_the_same_seed_gives_the_same_campaign_and_another_one_another():
    assert planned(FEW) == planned(FEW)
    other = msgspec.structs.replace(FEW, seed=2)
    assert planned(FEW)[0].errors != planned(other)[0].errors


def test_runs_of_a_series_differ_as_asked():
    options = msgspec.structs.replace(FEW, series=("1FFM0",), repeats=300, friction_scatter=0.02)
    frictions = np.array([test.truth["friction_dynamic"] for test in planned(options)])
    assert frictions.std() == pytest.approx(0.002, rel=0.15)
    mean = series_parameters(options, load_stand(), planned(options)[0].errors, "1FFM0")
    assert mean.friction_dynamic == 0.1


def test_a_run_says_what_is_stated_reads_by_what_is_true_and_knows_both(tmp_path):
    test = planned(FEW, tmp_path)[0]
    write_test(test)
    run = open_run(Path(test.path))
    assert run.metadata.gauges == load_gauges()
    assert run.metadata.table_mass_kg == load_stand().table_mass_kg
    assert run.metadata.truth["table_mass_kg"] == pytest.approx(131.6 + test.errors.table_mass_kg)
    assert run.end.time_base.scale_standard_uncertainty == 2e-5
    counts = load_counts(run)
    assert counts.dtype == np.int32
    assert np.array_equal(load_gauges().table.displacement_m(counts[:, 0].astype(float)), run.table_reading)
    held = slice(0, 190)
    swing = run.table_reading[held].mean() - run.table_reading[-100:].mean()
    assert swing == pytest.approx(0.012, rel=0.2)


def test_every_test_of_a_campaign_has_its_effects(tmp_path):
    ideal = msgspec.structs.replace(FEW, repeats=1, noise_m=0.0)
    real = msgspec.structs.replace(ideal, effects={"gauge-ratio": 0.02, "release-ramp": 0.02})
    (plain, *_), (test, *_) = planned(ideal, tmp_path / "ideal"), planned(real, tmp_path / "real")
    assert (test.truth["release_ramp_s"], test.truth["relative_gain"]) == (0.02, 0.02)
    for one in (plain, test):
        Path(one.path).parent.mkdir()
        write_test(one)
    before, after = open_run(Path(plain.path)), open_run(Path(test.path))
    held = before.time_s < 0.9
    np.testing.assert_allclose(after.table_reading[held], before.table_reading[held], atol=1e-8)
    assert np.abs(after.relative_reading - before.relative_reading).max() > 1e-4
    with pytest.raises(ValueError, match="is not known"):
        msgspec.structs.replace(FEW, effects={"ramp": 1.0})


def test_a_series_that_is_none_is_refused():
    with pytest.raises(ConfigError, match="9XX"):
        planned(CampaignOptions(series=("9XX",)))
    with pytest.raises(ValueError, match="repeats = 0"):
        CampaignOptions(repeats=0)


def test_the_tests_of_a_campaign_are_dated_before_they_are_made() -> None:
    options = CampaignOptions(series=("1FFM0", "1FFM1"), repeats=3)
    tests = plan_tests(options, load_stand(), load_gauges(), Path("runs"), START - duration(options))
    assert len(tests) == 6
    assert START - datetime.timedelta(minutes=3) < tests[-1].start_time < START
