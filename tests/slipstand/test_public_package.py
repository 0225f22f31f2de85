"""The package as a notebook uses it."""

import subprocess
import sys
from io import StringIO

import numpy as np
import pytest

import slipstand as api
from app.simulated_stand.series_motion import resolve_motion

REPEATS = 80


@pytest.fixture(scope="module")
def test():
    return api.simulate("1FFM0", seed=3)


@pytest.fixture(scope="module")
def result(test):
    return api.identify(test.record)


def test_importing_it_loads_nothing_else() -> None:
    code = "import sys, slipstand; print(sorted({'numpy', 'analysis', 'app', 'h5py'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_is_there() -> None:
    assert {name for name in api.__all__ if not hasattr(api, name)} == set()
    assert set(dir(api)) == set(api.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        api.nothing  # noqa: B018


def test_a_record_of_arrays_is_identified(test, result) -> None:
    record = api.Record.from_arrays(
        test.record.time_s.tolist(),
        test.record.table_displacement_m,
        test.record.relative_displacement_m,
        table_mass_kg=131.6,
        plate_mass_kg=test.parameters.plate_mass_kg,
    )
    found = api.identify(record)
    assert found["friction_dynamic"] == result["friction_dynamic"]
    assert found["friction_dynamic"].value == pytest.approx(test.parameters.friction_dynamic, rel=1e-3)
    assert list(found) == list(found.identification.results)


def test_gains_that_are_left_out_are_warned_of_and_make_no_line_that_is_no_number(result) -> None:
    assert "gain-not-stated" in [one.code for one in result.warnings]
    assert all(np.isfinite(line.standard_uncertainty) for line in result.budget)
    stated = api.Record.from_arrays(
        result.record.time_s, result.record.table_displacement_m, result.record.relative_displacement_m,
        table_mass_kg=131.6, plate_mass_kg=22.4, gain_uncertainties=(0.001, 0.001), clock_uncertainty=2e-5,
    )  # fmt: skip
    codes = [one.code for one in api.identify(stated).warnings]
    assert not {"gain-not-stated", "clock-not-timed"} & set(codes)


def test_a_clock_that_is_left_out_is_warned_of(test) -> None:
    readings = test.record.table_displacement_m, test.record.relative_displacement_m
    record = api.Record.from_arrays(test.record.time_s, *readings, table_mass_kg=131.6, plate_mass_kg=22.4)
    assert "clock-not-timed" in [one.code for one in api.identify(record).warnings]


def test_a_quantity_prints_with_the_digits_that_its_uncertainty_leaves() -> None:
    assert str(api.Quantity.normal(0.11000077376633005, 0.0001558979507805286, "1")) == "0.11000 ± 0.00016"
    assert str(api.Quantity.normal(0.31999891302307654, 6.5880200069818774e-06, "s")) == (
        "0.3199989 ± 0.0000066 s"
    )


def test_a_law_that_fails_is_as_uncertain_as_its_difference_from_the_plate_alone() -> None:
    record = api.simulate("1FFM0", friction_dynamic=0.10, friction_static=0.12, seed=2).record
    found = api.identify(record, model="coulomb")
    friction, plate = found["friction_dynamic"], found["friction_dynamic_plate"]
    assert found.model is not None
    assert not found.model.adequate
    assert friction.standard_uncertainty >= abs(friction.value - plate.value)
    assert abs(friction.value - 0.10) < 2.0 * friction.standard_uncertainty


@pytest.mark.parametrize(
    ("time_s", "masses", "fault"),
    [
        ([0.0, 1.0], (1.0, 1.0), "table_displacement_m has 3 values for 2 of time_s"),
        ([[0.0, 1.0, 2.0]], (1.0, 1.0), "time_s has 2 axes"),
        (["a", "b", "c"], (1.0, 1.0), "time_s is no array of numbers"),
        ([0.0, 1.0, 2.0], (0.0, 1.0), "table_mass_kg is 0.0: give a positive number"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(time_s, masses, fault) -> None:
    with pytest.raises(api.RecordError, match=fault):
        api.Record.from_arrays(time_s, [0.0, 0.0, 0.0], table_mass_kg=masses[0], plate_mass_kg=masses[1])


def test_a_run_gives_what_the_command_line_gives(tmp_path, slipstand) -> None:
    path = tmp_path / "run.h5"
    slipstand("simulate", "--series", "2SSM1", "-o", path)
    (by_command,) = slipstand("analyze", path, "--json").json
    of_run = api.identify(api.read_run(path))
    assert str(of_run).startswith("SIMULATED: ")
    assert "<b>SIMULATED: " in of_run._repr_html_()
    assert "<b>SIMULATED: " in api.pool(path)._repr_html_()
    run = api.read_run(path)
    result = api.identify(run)
    assert result.document["results"] == by_command["results"]
    assert result["period_s"].value == by_command["results"]["period_s"]["value"]
    assert run.series == "2SSM1"
    assert run.metadata["plate_mass_kg"] == run.record.masses.plate_mass_kg
    pooled = api.pool(tmp_path)
    table, by_command = pooled.to_dict(), slipstand("table", tmp_path, "--json").json
    origin, other = table.pop("origin"), by_command.pop("origin")
    assert table == by_command
    assert (origin["inputs_hash"], origin["reproduce"]) == (other["inputs_hash"], other["reproduce"])
    assert pooled.to_dataframe()["series"].tolist() == ["2SSM1"]
    assert "2SSM1" in str(pooled)
    assert "<td>2SSM1</td>" in pooled._repr_html_()


def test_a_run_that_is_not_there_is_told_in_one_line(tmp_path) -> None:
    with pytest.raises(api.RunError, match=r"absent\.h5"):
        api.read_run(tmp_path / "absent.h5")


def test_runs_without_any_result_are_no_table(tmp_path, slipstand) -> None:
    (tmp_path / "broken.h5").write_text("no run")
    with pytest.raises(api.RunError, match=r"none of the runs gives a result: .*broken\.h5"):
        api.pool(tmp_path)
    with pytest.raises(api.RunError, match=r"absent\.h5: there is no such file"):
        api.pool(tmp_path / "absent.h5")
    slipstand("simulate", "--series", "1FFM0", "-o", tmp_path / "run.h5")
    pooled = api.pool(str(tmp_path))
    assert len(pooled.campaign.rows) == 1
    ((run, reason),) = pooled.failures
    assert run == str(tmp_path / "broken.h5")
    assert reason.startswith("broken.h5 is not an HDF5 file")


def test_results_are_shown_as_text_table_and_figure(result) -> None:
    lines = str(result).splitlines()
    assert lines[0].startswith("f_d ")
    assert any(line.startswith("f_s ≥") for line in lines)
    assert result.verdict in lines
    assert "<td>f<sub>d</sub></td>" in result._repr_html_()
    frame = result.to_dataframe()
    assert frame.loc["period_s", "value"] == result["period_s"].value
    assert frame.loc["period_s", "low_95"] == result["period_s"].interval_95[0]
    assert len(result.plot().axes) == 4  # residuals of each gauge have a panel


@pytest.mark.timeout(1800)  # 80 runs to identify, on a busy computer
def test_correlations_are_those_of_repeated_tests() -> None:
    names = (
        "friction_dynamic",
        "table_acceleration_max_m_per_s2",
        "pullback_m",
        "period_s",
        "damping_n1_per_s",
    )
    found = [api.identify(api.simulate("3SSLM0", seed=seed, rate_hz=300.0).record) for seed in range(REPEATS)]
    values = np.array([[one[name].value for name in names] for one in found])
    seen = np.corrcoef(values.T)
    known, matrix = found[0].correlation()
    places = [known.index(name) for name in names]
    stated = matrix[np.ix_(places, places)]
    assert np.linalg.eigvalsh(matrix).min() > -1e-9
    together = np.array([[True] * 3 + [False] * 2] * 3 + [[False] * 3 + [True] * 2] * 2)
    bound = 4.0 * (1.0 - stated**2) / np.sqrt(REPEATS) + 0.02
    assert (np.abs(seen - stated) < bound)[together].all()


def test_budgets_go_to_gtc(result) -> None:
    gtc = pytest.importorskip("GTC")
    numbers = result.to_gtc()
    friction = numbers["friction_dynamic"]
    assert gtc.value(friction) == result["friction_dynamic"].value
    assert gtc.uncertainty(friction) == pytest.approx(result["friction_dynamic"].standard_uncertainty)
    known, matrix = result.correlation()
    pair = [known.index(name) for name in ("friction_dynamic", "pullback_m")]
    stated = matrix[pair[0], pair[1]]
    assert gtc.get_correlation(friction, numbers["pullback_m"]) == pytest.approx(stated)
    ratio = friction / numbers["pullback_m"]
    shares = [
        result[name].standard_uncertainty / result[name].value for name in ("friction_dynamic", "pullback_m")
    ]
    variance = shares[0] ** 2 + shares[1] ** 2 - 2.0 * stated * shares[0] * shares[1]
    assert (gtc.uncertainty(ratio) / gtc.value(ratio)) ** 2 == pytest.approx(variance)


@pytest.mark.parametrize(
    "compute",
    [
        lambda known, _: known["friction_dynamic"] / known["pullback_m"],
        lambda known, functions: functions.sqrt(known["stiffness_n_per_m"]) * known["period_s"],
        lambda known, functions: functions.exp(-known["damping_n1_per_s"] * known["period_s"]),
    ],
    ids=["correlated ratio", "sqrt", "exp"],
)
def test_uncertainties_and_gtc_compute_alike(result, compute) -> None:
    gtc, functions = pytest.importorskip("GTC"), pytest.importorskip("uncertainties.umath")
    ours, theirs = compute(result.to_uncertainties(), functions), compute(result.to_gtc(), gtc)
    assert ours.nominal_value == pytest.approx(gtc.value(theirs), rel=1e-12)
    assert ours.std_dev == pytest.approx(gtc.uncertainty(theirs), rel=1e-6)


def test_the_log_decrement_of_damping_and_period_is_the_fitted_one(result) -> None:
    """A product of two results has the uncertainty that the fit gives it, by the stated correlation."""
    pytest.importorskip("uncertainties")
    numbers = result.to_uncertainties()
    product = numbers["damping_n1_per_s"] * numbers["period_s"]
    fitted = result["log_decrement"]
    assert product.nominal_value == pytest.approx(fitted.value, rel=1e-9)
    assert product.std_dev == pytest.approx(fitted.standard_uncertainty, rel=1e-6)
    assert (product - numbers["log_decrement"]).std_dev < 1e-3 * fitted.standard_uncertainty


def test_a_figure_is_drawn_in_its_style_by_a_notebook(result) -> None:
    drawn = StringIO()
    result.plot().savefig(drawn, format="svg")
    assert "IBMPlexSans" in drawn.getvalue()
    assert "DejaVu" not in drawn.getvalue()


def test_one_mass_of_arrays(test) -> None:
    tail = test.record.time_s > 6.0
    record = api.Record.from_arrays(
        test.record.time_s[tail], test.record.table_displacement_m[tail], table_mass_kg=1.0, plate_mass_kg=1.0
    )
    found = api.one_mass(record)
    assert found.kind == "one-mass"
    assert found["period_s"].value == pytest.approx(0.32, rel=1e-3)


def test_motions_of_values_and_of_a_series_with_other_values() -> None:
    changed = api.simulate("1FFM0", friction_dynamic=0.12).parameters
    assert changed.friction_dynamic == 0.12
    assert changed.stiffness_n_per_m == resolve_motion("1FFM0", {}).stiffness_n_per_m
    with pytest.raises(api.AnalysisError, match="friction is no parameter of a motion: give pullback_m"):
        api.simulate("1FFM0", friction=0.12)
    with pytest.raises(api.AnalysisError, match="plate_mass_kg, friction_dynamic, period_s"):
        api.simulate(pullback_m=0.012, table_mass_kg=131.6)
    with pytest.raises(api.AnalysisError, match="period_s and stiffness_n_per_m say the same"):
        api.simulate("1FFM0", period_s=0.3, stiffness_n_per_m=1e4)


def test_a_plan_is_that_of_the_command_line(slipstand) -> None:
    planned = api.plan("1FFM0")
    document = slipstand("plan", "--series", "1FFM0", "--ideal-stand", "--json").json
    friction = planned.plan.results["friction_dynamic"]
    assert friction.standard_uncertainty == document["results"]["friction_dynamic"]["standard_uncertainty"]
    assert "f_d to expect" in str(planned)
    assert "gauge 2" in planned._repr_html_()


def test_a_calibration_of_arrays() -> None:
    counts = np.array([0.0, 1000.0, 2000.0, 3000.0, 2000.0, 1000.0, 0.0])
    found = api.calibrate(counts, 1e-6 * counts)
    assert found.gain_m_per_count.value == pytest.approx(1e-6)
