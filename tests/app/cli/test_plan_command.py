"""`slipstand plan`: prediction of a test."""

import math

import pytest

from analysis.plan import PlannedTest, plan
from app.runs.plan_json import build_planned_test
from config.files import load_gauges, load_stand, settings_file
from tools import page_commands


@pytest.fixture(autouse=True)
def no_recordings(tmp_path, monkeypatch):
    """No runs of the user's: the last ones are planned with."""
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "runs"))


def test_plan_tells_what_simulate_simulates(slipstand):
    planned = slipstand("plan", "--series", "1FFM0", "--json").json
    simulated = slipstand("simulate", "--series", "1FFM0", "--json").json

    for name in ("residual_displacement_m", "slip_end_s", "phases", "table_velocity_max_m_per_s"):
        assert planned[name] == simulated[name], name
    assert planned["msk64_degree"] == "IX"
    assert planned["parameters"]["pullback_m"] == 0.012
    assert planned["gauges"]["table"]["highest_m"] == 0.012
    assert planned["tests_without_recentring"] == 2
    assert not planned["warnings"]


def test_plan_takes_uncertainties_of_stand_and_calibration(slipstand, tmp_path):
    found = slipstand("plan", "--series", "1FFM0", "--json").json["results"]["friction_dynamic"]
    shipped = settings_file("gauges.toml").read_text("utf-8")
    better = tmp_path / "better.toml"
    better.write_text(shipped.replace("uncertainty = 0.003", "uncertainty = 0.001"), "utf-8")
    sharper = slipstand("plan", "--series", "1FFM0", "--calibration", better, "--json").json
    from_python = _from_python(slipstand("plan", "--series", "1FFM0", "--json").json["parameters"])

    assert found["value"] == 0.1
    assert found["standard_uncertainty"] == from_python
    assert (
        sharper["results"]["friction_dynamic"]["standard_uncertainty"] < 0.6 * found["standard_uncertainty"]
    )


def _from_python(parameters):
    from analysis.motion.two_mass import TwoMassParameters

    test: PlannedTest = build_planned_test(TwoMassParameters(**parameters), load_stand(), load_gauges())
    return plan(test).results["friction_dynamic"].standard_uncertainty


def test_plan_says_honestly_what_halves_the_uncertainty(slipstand):
    calibrated = slipstand("plan", "--series", "1FFM0")
    assert "f_d to expect          0.10000 ± 0.00022" in calibrated.out
    assert "No rate halves it" in calibrated.out
    assert "Gauges calibrated 2.2 times as well halve it" in calibrated.out

    ways = slipstand("plan", "--series", "1FFM0", "--rate", 50, "--noise", 3e-4, "--json").json["halved_by"]
    rate = next(way for way in ways if way["means"] == "rate")
    assert rate["value"] > 4 * 50


def test_plan_without_slip_says_how_far_to_pull(slipstand):
    said = slipstand("plan", "--series", "3SSM0", "--static-friction", 0.9)

    assert said.code == 0
    assert "warning no-slip" in said.out
    assert "9.86 mm" in said.out
    assert "f_d to expect" not in said.out


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (("--series", "9XXM0"), "9XXM0"),
        (("--pullback", 0.01), "--table-mass"),
        (("--series", "1FFM0", "--pullback", -1), "--pullback -1 m is farther than stands are pulled back"),
        (("--series", "1FFM0", "--rate", 0), "--rate 0"),
        (("--series", "1FFM0", "--noise", -1e-5), "--noise -1e-05"),
        (("--series", "1FFM0", "--rate", 1e9), "makes 1e+10 samples"),
        (("--series", "1FFM0", "--static-friction", 0.05), "friction_static is 0.05"),
        (("--series", "1FFM0", "--calibration", "nowhere.toml"), "nowhere.toml"),
    ],
)
def test_plan_refuses_what_cannot_be_in_one_line(slipstand, options, fault):
    said = slipstand("plan", *options)

    assert said.code == 1
    assert said.out == ""
    assert fault in said.err
    assert said.err.count("\n") == 1


@pytest.mark.usefixtures("unhurried")
def test_effects_of_the_last_runs_are_planned_with(slipstand, real_stand_runs):
    test = ("plan", "--series", "1FFM0", "--rate", 500, "--duration", 5, "--last-runs", real_stand_runs)
    planned = slipstand(*test, "--json").json
    ideal = slipstand(*test, "--ideal-stand", "--json").json
    last = planned["last_runs"]
    friction = planned["results"]["friction_dynamic"]

    assert [effect["name"] for effect in last["effects_of_stand"]] == ["second-mode", "release-ramp"]
    assert last["planned_with"] == ["second-mode"]
    assert len(last["runs"]) == 3
    assert last["model_spread"] > 0.0
    assert planned["residual_displacement_m"] != ideal["residual_displacement_m"]
    assert last["ideal_standard_uncertainty"] == ideal["results"]["friction_dynamic"]["standard_uncertainty"]
    assert friction["standard_uncertainty"] > last["ideal_standard_uncertainty"]
    # what runs of this stand report, at the same rate and for the same time; a plan knows no scatter between
    observed = last["friction_dynamic"]
    reported = math.hypot(observed["noise"], observed["model"], observed["shared"])
    assert friction["standard_uncertainty"] == pytest.approx(0.1 * reported, rel=0.05)
    assert planned["noise_part"] == pytest.approx(0.1 * observed["noise"], rel=0.3)
    assert ideal["last_runs"] is None


@pytest.mark.usefixtures("unhurried")
def test_plan_says_what_the_last_runs_show_and_what_it_costs(slipstand, real_stand_runs, monkeypatch):
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(real_stand_runs))
    said = slipstand("plan", "--series", "1FFM0").out

    assert f"last runs              3 kept results in {real_stand_runs}" in said
    assert "  second-mode          3 of 3 runs: a second mode at " in said
    assert "  planned with         second-mode; without, f_d would be uncertain by 0.00022" in said
    assert "  one of them          One run gives f_d to 0.2" in said
    shown = page_commands.shown_lines("slipstand plan --series 1FFM0 --last-runs real-stand")
    assert page_commands.faults(shown, said.replace(str(real_stand_runs), "real-stand").splitlines()) == [], (
        said
    )


def test_plan_refuses_a_folder_of_last_runs_that_does_not_exist(slipstand, tmp_path):
    said = slipstand("plan", "--series", "1FFM0", "--last-runs", tmp_path / "nowhere")

    assert (said.code, said.out) == (1, "")
    assert "nowhere: there is no such folder" in said.err
