"""Options of `slipstand analyze`, and what it refuses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_kit import assert_one_error_line

from analysis.motion.one_mass import OneMassDecay, simulate
from analysis.synthetic import Truth, simulate_readings

MASSES = ["--series", "1FFM0"]
TABLE_KG, ADDED_KG = 131.6, 20.0
STIFFNESS, DAMPING = 60_000.0, 30.0


def stored(slipstand: Any, path: Path, *columns: Any, options: tuple[Any, ...] = ("--unit", "m")) -> Path:
    """A run made of columns time, gauge 1 and perhaps gauge 2."""
    csv = path.with_suffix(".csv")
    np.savetxt(csv, np.column_stack(columns), delimiter=",", fmt="%.9g")
    arguments = ["--no-header", "--time", 0, "--table", 1]
    arguments += ["--relative", 2] if len(columns) > 2 else []
    assert slipstand("import", csv, *arguments, *options, *MASSES, "-o", path, "--force").code == 0
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("asked")


def pullback_run(slipstand: Any, folder: Path, **truth: Any) -> Path:
    """A pullback test of known truth."""
    return stored(slipstand, folder / "test.h5", *simulate_readings(Truth(**({"rate_hz": 250.0} | truth))))


def bare(slipstand: Any, path: Path, mass_kg: float, coulomb_m: float = 0.0, **changes: Any) -> Path:
    """A free decay of a mass on the stand's plates."""
    n = DAMPING / (2.0 * mass_kg)
    period_s = 2.0 * np.pi / np.sqrt(STIFFNESS / mass_kg - n * n)
    decay = OneMassDecay(float(period_s), n, coulomb_m, 0.1, 0.01)
    time_s = changes.get("time_s", np.arange(4000) / 400.0)
    rng = np.random.default_rng(3)
    noise_m = 1e-5 * rng.standard_normal(len(time_s))
    return stored(slipstand, path, time_s, simulate(decay, time_s).displacement_m + noise_m)


def test_what_an_imported_record_does_not_state_is_told(slipstand: Any, folder: Path) -> None:
    (document,) = slipstand("analyze", pullback_run(slipstand, folder), "--json").json
    codes = {warning["code"] for warning in document["warnings"]}
    assert {"gain-not-stated", "clock-not-timed"} <= codes
    without_value = {"contribution_to", "source"}
    lines = {tuple(line[key] for key in sorted(without_value)) for line in document["budget"]}
    clock = {name for name, source in lines if source == "time base (not stated)"}
    assert {"period_s", "stiffness_n_per_m", "table_velocity_max_m_per_s", "friction_dynamic"} <= clock
    assert not {"log_decrement", "residual_displacement_m"} & clock


def test_both_methods_stand_side_by_side(slipstand: Any, folder: Path) -> None:
    run = pullback_run(slipstand, folder)
    (document,) = slipstand("analyze", run, "--monte-carlo", 100, "--json").json
    drawn = document["monte_carlo"]
    assert (drawn["draws"], drawn["refits"], drawn["compared"]) == (100_000, 100, "refits")
    for name in ("friction_dynamic", "period_s", "damping_n1_per_s"):
        both = drawn["results"][name]
        assert both["budget"] == document["results"][name]
        for method in ("drawn", "refitted"):
            found = both[method]
            u = document["results"][name]["standard_uncertainty"]
            assert found["standard_uncertainty"] == pytest.approx(u, rel=0.3)
            assert found["interval_95"][0] < found["value"] < found["interval_95"][1]
        assert both["agrees"] is (both["difference"] <= both["tolerance"])
        assert both["agrees"]
    said = slipstand("analyze", run, "--monte-carlo", 0).out
    assert "100000 draws\n" in said
    assert "agrees with the budget" in said


def test_classical_figures_stand_beside_the_fitted(slipstand: Any, folder: Path) -> None:
    run = pullback_run(slipstand, folder)
    (document,) = slipstand("analyze", run, "--json").json
    classical = document["classical"]
    assert classical["period_s"] == pytest.approx(0.32, rel=1e-4)
    decrement = classical["log_decrement"]
    assert decrement["value"] == pytest.approx(0.0384, abs=4.0 * decrement["standard_uncertainty"])
    assert classical["cycles"] > 10
    assert any(friction == pytest.approx(0.1, abs=3e-4) for friction in classical["friction_of_residual"])
    assert classical["friction_of_paper"] == pytest.approx(0.1, abs=0.002)
    assert document["results"]["friction_static_upper"]["value"] > 0.09
    said = slipstand("analyze", run).out
    for words in (
        "by the paper's procedure",
        "u_s allows    f_d = ",
        "so it cannot choose one",
        "f_s at least",
    ):
        assert words in said


def test_every_law_tried_the_largest_rates_and_the_sources_of_uncertainty_are_told(
    slipstand: Any, folder: Path
) -> None:
    run = pullback_run(slipstand, folder)
    (document,) = slipstand("analyze", run, "--json").json
    said = slipstand("analyze", run).out
    for law in document["model"]["tried"]:
        assert f"{law['name']} (BIC {law['bic']:.1f}, residual " in said
    assert f"MSK-64        degree {document['results']['msk64_degree']}\n" in said
    assert "v_max         table " in said
    assert "a_max         table " in said
    assert "± of f_d      " in said
    assert "s after the release" in said


def test_a_result_without_slip_has_no_classical_friction(slipstand: Any, folder: Path) -> None:
    (document,) = slipstand("analyze", pullback_run(slipstand, folder, friction_dynamic=0.6), "--json").json
    assert document["classical"] is None
    assert "no-slip" in [warning["code"] for warning in document["warnings"]]


def test_masses_that_are_not_those_of_the_run_are_said(slipstand: Any, folder: Path) -> None:
    run = pullback_run(slipstand, folder)
    (document,) = slipstand("analyze", run, "--plate-mass", 22.4, "--json").json
    assert "masses-given" not in [warning["code"] for warning in document["warnings"]]
    (document,) = slipstand("analyze", run, "--plate-mass", 22.5, "--table-mass", 131.5, "--json").json
    said = {warning["code"]: warning["message"] for warning in document["warnings"]}["masses-given"]
    assert "plate mass 22.5 kg as given, not 22.4 kg as in the run" in said
    assert "table mass 131.5 kg as given, not 131.6 kg" in said


def test_an_expired_calibration_travels_with_the_run(slipstand: Any, folder: Path) -> None:
    begun = ("--unit", "m", "--begun", "2026-05-04T14:03:00+02:00")
    run = stored(slipstand, folder / "begun.h5", *simulate_readings(Truth(rate_hz=250.0)), options=begun)
    calibration = folder / "expired.toml"
    gauge = "[{}]\ngain_m_per_count = 1.0\nzero_count = 0.0\nvalid_until = 2020-01-31\n"
    calibration.write_text(gauge.format("table") + gauge.format("relative"))
    assert slipstand("edit", run, "--calibration", calibration).code == 0
    (document,) = slipstand("analyze", run, "--json").json
    said = [w["message"] for w in document["warnings"] if w["code"] == "calibration-expired"]
    assert len(said) == 2
    assert "gauge 1 (table) was valid until 2020-01-31" in said[0]


def test_a_law_that_the_record_cannot_tell_is_refused_by_its_parameter(slipstand: Any, folder: Path) -> None:
    one_way = pullback_run(slipstand, folder, friction_dynamic=0.3, pullback_m=0.009)
    outcome = slipstand("analyze", one_way, "--model", "coulomb+tilt")
    if outcome.code == 0:  # the record tells the tilt after all
        assert "tilt" in outcome.out
    else:
        assert_one_error_line(outcome, "tilt_rad and friction_dynamic act alike")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--model", "nope"], "--model 'nope'"),
        (["--kind", "three-mass"], "'three-mass'"),
        (["--kind", "one-mass", "--model", "coulomb"], "--kind one-mass"),
        (["--kind", "one-mass", "--monte-carlo", "200"], "--kind one-mass"),
        (["--monte-carlo", "-1"], "--monte-carlo -1"),
        (["--monte-carlo", "7"], "--monte-carlo 7"),
        (["--monte-carlo", "2000000"], "--monte-carlo 2000000"),
        (["--table-mass", "nan"], "--table-mass nan"),
        (["--plate-mass", "-3"], "--plate-mass -3"),
        (["--added-mass", "20"], "--added-mass needs"),
        (["--added-mass", "0"], "--added-mass 0"),
        (["--added-mass-uncertainty", "0.1"], "goes with --added-mass"),
        (["--from", "3", "--until", "2"], "--from 3 is not before --until 2"),
        (["--until", "nan"], "--until nan"),
        (["--release", "0"], "--release 0"),
        (["--release", "1", "--kind", "one-mass"], "--release is for two masses"),
        (["--figure", "a.bmp"], "a.bmp"),
    ],
)
def test_what_cannot_be_is_refused_once_before_any_run_is_read(
    slipstand: Any, arguments: list[str], said: str
) -> None:
    assert_one_error_line(slipstand("analyze", "nix.h5", *arguments), said)


def test_runs_that_are_not_two_have_no_added_mass(slipstand: Any) -> None:
    three = ["a.h5", "b.h5", "c.h5", "--kind", "one-mass", "--added-mass", "20"]
    assert_one_error_line(slipstand("analyze", *three), "two runs")


def test_a_bare_table_gives_stiffness_damping_and_dry_friction(slipstand: Any, tmp_path: Path) -> None:
    run = bare(slipstand, tmp_path / "bare.h5", TABLE_KG, coulomb_m=5e-5)
    (document,) = slipstand("analyze", run, "--kind", "one-mass", "--json").json
    results = document["results"]
    for name, truth in (
        ("stiffness_n_per_m", STIFFNESS),
        ("damping_coefficient_kg_per_s", DAMPING),
        ("coulomb_displacement_m", 5e-5),
    ):
        low, high = results[name]["interval_95"]
        half = 0.5 * (high - low)
        assert low - half < truth < high + half
    assert results["coulomb_significant"] is True
    assert "biased" in document["classical"]["notes"][0]
    plain, fitted = document["classical"]["log_decrement"]["value"], results["log_decrement"]["value"]
    assert plain > 1.05 * fitted
    assert "Coulomb friction is significant" in slipstand("analyze", run, "--kind", "one-mass").out


def test_two_decays_with_a_known_added_mass_give_the_mass_of_the_table(
    slipstand: Any, tmp_path: Path
) -> None:
    alone = bare(slipstand, tmp_path / "alone.h5", TABLE_KG)
    loaded = bare(slipstand, tmp_path / "loaded.h5", TABLE_KG + ADDED_KG)
    asked = ("analyze", alone, loaded, "--kind", "one-mass", "--added-mass", ADDED_KG)
    *_, document = slipstand(*asked, "--added-mass-uncertainty", 0.01, "--json").json
    mass = document["results"]["table_mass_kg"]
    assert document["runs"] == [str(alone), str(loaded)]
    assert mass["value"] == pytest.approx(TABLE_KG, abs=4.0 * mass["standard_uncertainty"])
    assert 0.5 * 0.01 * TABLE_KG / ADDED_KG < mass["standard_uncertainty"] < 1.0
    said = slipstand(*asked).out
    assert "table mass 131." in said
    assert "beside its own 131.6 kg: stiffness and damping coefficient are those of 151.6 kg" in said


def test_stiffness_and_damping_of_a_loaded_table_are_those_of_both_masses(
    slipstand: Any, tmp_path: Path
) -> None:
    alone = bare(slipstand, tmp_path / "alone.h5", TABLE_KG)
    loaded = bare(slipstand, tmp_path / "loaded.h5", TABLE_KG + ADDED_KG)
    added = ("--kind", "one-mass", "--added-mass", ADDED_KG)
    unloaded, of_two, _ = slipstand("analyze", alone, loaded, *added, "--json").json
    assert "mass-added" not in [warning["code"] for warning in unloaded["warnings"]]
    (of_one,) = slipstand("analyze", loaded, *added, "--json").json
    for document in (unloaded, of_two, of_one):
        results = document["results"]
        for name, truth in (("stiffness_n_per_m", STIFFNESS), ("damping_coefficient_kg_per_s", DAMPING)):
            low, high = results[name]["interval_95"]
            assert low - (high - low) < truth < high + (high - low)
    assert of_one["results"] == of_two["results"]
    (unsure,) = slipstand("analyze", loaded, *added, "--added-mass-uncertainty", 5, "--json").json
    share = unsure["results"]["stiffness_n_per_m"]["standard_uncertainty"] / STIFFNESS
    assert share == pytest.approx(5.0 / (TABLE_KG + ADDED_KG), rel=0.01)


def test_a_span_and_a_release_are_chosen(slipstand: Any, tmp_path: Path) -> None:
    """Two tests in one record, the table pulled back in 3 s between them; the longer decay comes first."""
    rate_hz, rng = 250.0, np.random.default_rng(1)
    first = simulate_readings(Truth(rate_hz=rate_hz, duration_s=12.0))
    second = simulate_readings(Truth(rate_hz=rate_hz, duration_s=8.0, friction_dynamic=0.15))
    channels = []
    for one, other in zip(first[1:], second[1:], strict=True):
        pulled_m = np.linspace(one[-1], other[0], 750) + 2e-5 * rng.standard_normal(750)
        channels.append(np.concatenate((one, pulled_m, other)))
    ended_s = float(first[0][-1])
    run = stored(slipstand, tmp_path / "two.h5", np.arange(len(channels[0])) / rate_hz, *channels)

    def friction(*chosen: object) -> tuple[float, str]:
        (document,) = slipstand("analyze", run, *chosen, "--json").json
        said = {warning["code"]: warning["message"] for warning in document["warnings"]}
        return document["results"]["friction_dynamic"]["value"], said.get("released-twice", "")

    assert friction()[0] == pytest.approx(0.1, abs=1e-3)
    assert friction("--release", 1)[0] == pytest.approx(0.1, abs=1e-3)
    value, said = friction("--release", 2)
    assert value == pytest.approx(0.15, abs=1e-3)
    assert "2 times" in said
    assert "the decay after number 2 is used" in said
    assert friction("--from", ended_s + 3.0) == (pytest.approx(0.15, abs=1e-3), "")
    assert friction("--until", ended_s - 1.0) == (pytest.approx(0.1, abs=1e-3), "")
    assert_one_error_line(slipstand("analyze", run, "--release", 3), "the record has no release 3: 2 were")


def test_runs_in_the_wrong_order_give_no_mass(slipstand: Any, tmp_path: Path) -> None:
    alone = bare(slipstand, tmp_path / "alone.h5", TABLE_KG)
    loaded = bare(slipstand, tmp_path / "loaded.h5", TABLE_KG + ADDED_KG)
    outcome = slipstand("analyze", loaded, alone, "--kind", "one-mass", "--added-mass", ADDED_KG, "--json")
    assert_one_error_line(outcome, "The loaded period must be the longer one")


def test_uneven_gappy_and_coarse_readings_are_welcome(slipstand: Any, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    time_s = np.cumsum(rng.uniform(0.002, 0.008, 2200))
    time_s = time_s[(time_s < 2.0) | (time_s > 2.7)]
    run = bare(slipstand, tmp_path / "uneven.h5", TABLE_KG, time_s=time_s)
    (document,) = slipstand("analyze", run, "--kind", "one-mass", "--json").json
    assert document["model"]["adequate"]
    assert document["results"]["stiffness_n_per_m"]["value"] == pytest.approx(STIFFNESS, rel=1e-3)


def test_a_pendulum_is_told_in_its_own_unit(slipstand: Any, tmp_path: Path) -> None:
    time_s = np.arange(3000) / 100.0
    angle = 0.2 * np.exp(-0.03 * time_s) * np.cos(5.0 * time_s)
    angle += 1e-4 * np.random.default_rng(1).standard_normal(3000)
    kept = {"options": ("--gain", "1", "--unit-name", "rad")}
    run = stored(slipstand, tmp_path / "pendulum.h5", time_s, angle, **kept)
    said = slipstand("analyze", run, "--kind", "one-mass").out
    assert "rad (Coulomb friction is not significant)" in said
    assert "noise 9.96e-05 rad" in said
    assert_one_error_line(slipstand("analyze", run), "--kind one-mass")


@pytest.mark.parametrize("kind", ["two modes", "driven", "noise"])
def test_what_is_no_free_decay_is_never_a_bare_number(slipstand: Any, tmp_path: Path, kind: str) -> None:
    time_s = np.arange(4000) / 400.0
    values = {
        "two modes": 0.01 * np.exp(-0.2 * time_s) * (np.cos(20.0 * time_s) + 0.6 * np.cos(33.0 * time_s)),
        "driven": 0.01 * np.cos(20.0 * time_s),
        "noise": np.zeros(4000),
    }[kind]
    values = values + 1e-5 * np.random.default_rng(0).standard_normal(4000)
    run = stored(slipstand, tmp_path / "other.h5", time_s, values)
    outcome = slipstand("analyze", run, "--kind", "one-mass", "--json")
    (document,) = outcome.json
    assert "error" in document or document["model"]["adequate"] is False
    assert outcome.code == (1 if "error" in document else 0)
