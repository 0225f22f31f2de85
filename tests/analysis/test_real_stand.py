"""The independent simulator of real stands against closed forms, energy, and the exact solver."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import expm

from analysis.laws import stand_parts
from analysis.laws.catalogue import COMPARED_LAWS, FALLBACK_LAWS
from analysis.motion.two_mass import TwoMassParameters
from benchmarks import study_real_stand
from benchmarks.real_effects import EFFECTS, draw_scene
from benchmarks.real_gauges import GRID_HZ, RealGauge
from benchmarks.real_record import simulate
from benchmarks.real_stand import BASE, BASE_V, BRISTLE, REL, WORK, RealStand, U, V, W

TIMES_S = np.linspace(0.0, 6.0, 3001)
STUCK = RealStand(friction_static_ratio=100.0)
UNDAMPED = RealStand(damping_n1_per_s=0.0)
FRICTIONS = {
    "film": {"film_s_per_m": 2.0},
    "logarithm": {"log_per_decade": -0.03},
    "gradient": {"friction_gradient_per_m": 5.0},
    "wave": {"friction_wave": 0.05},
    "wear": {"friction_wear_per_m": 1.5},
    "Stribeck": {"friction_static_ratio": 1.4, "stribeck_m_per_s": 0.02},
    "static": {"friction_static_ratio": 1.4},
    "hardening": {"spring_hardening": 0.03},
    "spring asymmetry": {"spring_asymmetry": -0.03},
}


def stiffness(stand):
    square = (2.0 * np.pi / stand.period_s) ** 2 + stand.damping_n1_per_s**2
    return square * (stand.table_mass_kg + stand.plate_mass_kg)


@pytest.mark.parametrize("values", [{}, {"tilt_rad": 1e-3}, {"friction_static": 0.15, "tilt_rad": -5e-4}])
def test_the_ideal_stand_moves_as_the_exact_solver_says(values):
    stand = RealStand(
        tilt_rad=values.get("tilt_rad", 0.0), friction_static_ratio=values.get("friction_static", 0.1) / 0.1
    )
    exact = TwoMassParameters.from_free_decay(
        period_s=0.32, damping_n1_per_s=0.12, plate_mass_kg=22.4, friction_dynamic=0.1, pullback_m=0.012,
        table_mass_kg=131.6, gravity_m_per_s2=9.81, **values,
    ).simulate(6.1)  # fmt: skip

    motion = stand.simulate(6.1)

    expected = exact.sample_displacements(TIMES_S)
    np.testing.assert_allclose(motion.sample(TIMES_S)[[U, REL]], expected, atol=1e-10)
    assert motion.friction_dynamic == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize("values", FRICTIONS.values(), ids=FRICTIONS)
def test_what_the_stand_loses_is_the_work_of_friction(values):
    stand = replace(UNDAMPED, **values)
    c, u0 = stiffness(stand), stand.pullback_m

    def energy(y):
        x = y[U] / u0
        springs = 1.0 + 2.0 / 3.0 * stand.spring_asymmetry * x + 0.5 * stand.spring_hardening * x**2
        kinetic = stand.table_mass_kg * y[V] ** 2 + stand.plate_mass_kg * (y[V] + y[W]) ** 2
        return 0.5 * (kinetic + c * y[U] ** 2 * springs) + stand.plate_mass_kg * 9.81 * y[WORK]

    energies = energy(stand.simulate(6.0).sample(TIMES_S))

    np.testing.assert_allclose(energies, energies[0], rtol=1e-6)


def test_presliding_is_a_spring_that_saturates():
    stand = RealStand(presliding_m=1e-6)
    hard = RealStand().simulate(6.0).sample(TIMES_S)
    soft = stand.simulate(6.0)

    states = soft.sample(TIMES_S)

    assert np.abs(states[BRISTLE]).max() <= 1e-6
    assert np.abs(states[[U, REL]] - hard[[U, REL]]).max() < 2e-4
    assert soft.friction_dynamic == pytest.approx(0.1, rel=1e-9)


def test_a_loose_part_gives_the_second_mode_its_frequency_and_share():
    stand = replace(
        STUCK, damping_n1_per_s=0.0, second_mode_frequency_hz=9.0, second_mode_share=0.02,
        second_mode_damping_ratio=0.0,
    )  # fmt: skip

    u = stand.simulate(6.0).sample(TIMES_S)[U]

    phases = 2.0 * np.pi * np.outer(TIMES_S, [1.0 / 0.32, 9.0])
    expected = np.cos(phases) @ [0.98, 0.02] * stand.pullback_m
    np.testing.assert_allclose(u, expected, atol=1e-10)


def test_a_soft_base_moves_as_the_matrix_exponential_says():
    stand = replace(STUCK, base_compliance=0.03, base_mass_kg=500.0)
    joint, c = stand.table_mass_kg + stand.plate_mass_kg, stiffness(stand)
    damping, base_stiffness = 2.0 * stand.damping_n1_per_s * joint, c / 0.03
    base_damping = 2.0 * stand.base_damping_ratio * np.sqrt(base_stiffness * 500.0)
    base = np.array([c, damping, -base_stiffness, -base_damping]) / 500.0
    table = np.array([-c, -damping, 0.0, 0.0]) / joint
    rates = np.array([[0, 1, 0, 0], table - base, [0, 0, 0, 1], base])
    times = TIMES_S[::100]

    states = stand.simulate(6.0).sample(times)[[U, V, BASE, BASE_V]]

    start = [stand.pullback_m, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(states.T, [expm(rates * t) @ start for t in times], atol=1e-9)


def test_rolling_friction_takes_its_share_of_each_half_cycle():
    x_k = 5e-5
    stand = replace(STUCK, stand_friction_m=x_k)
    u = stand.simulate(30.0).sample(np.linspace(0.0, 30.0, 300_001))[U]

    turns = np.abs(u[np.flatnonzero(np.diff(np.sign(np.diff(u)))) + 1])[:10]

    b = np.exp(-0.12 * 0.32 / 2.0)
    np.testing.assert_allclose(turns[1:], b * turns[:-1] - (1.0 + b) * x_k, atol=1e-8)
    assert abs(u[-1]) < x_k
    assert u[-1] == u[-1000]


def test_a_ramp_of_the_holding_force_starts_the_table_half_a_ramp_late():
    """Beyond the ramp the stuck table is off by terms of second order in the ramp's length alone."""
    ramp = replace(STUCK, release_ramp_s=0.004).simulate(6.0).sample(TIMES_S)[U]
    sudden = STUCK.simulate(6.0).sample(TIMES_S - 0.002)[U]

    late = TIMES_S > 0.004
    np.testing.assert_allclose(
        ramp[late], sudden[late], atol=0.012 * (0.004 * 2.0 * np.pi / 0.32) ** 2 / 20.0
    )


def test_leaf_springs_swing_as_energy_says():
    stand = replace(UNDAMPED, friction_static_ratio=100.0, arc_per_m=2.0)
    mass = stand.table_mass_kg + stand.plate_mass_kg

    u, v = stand.simulate(6.0).sample(TIMES_S)[[U, V]]

    energy = mass * v**2 * (1.0 + (2.0 * u) ** 2) + stiffness(stand) * u**2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)


@pytest.mark.parametrize(
    ("kind", "order", "corner_hz"),
    [("rc", 1, 20.0), ("rc", 2, 20.0), ("butterworth", 4, 5.0), ("bessel", 4, 20.0), ("sinc", 3, 50.0)],
)
def test_filters_respond_as_their_transfer_function(kind, order, corner_hz):
    since_s = np.arange(0.0, 4.0, 1.0 / GRID_HZ)
    times_s = np.arange(2.5, 3.9, 1e-3)
    angular = 2.0 * np.pi * 3.1

    read = RealGauge(filter=kind, order=order, corner_hz=corner_hz).read(
        np.cos(angular * since_s), 0.0 * since_s, since_s, times_s
    )

    if kind == "rc":
        response = (1.0 + 3.1j / corner_hz * np.sqrt(2.0 ** (1.0 / order) - 1.0)) ** -order
    elif kind == "sinc":
        x = 3.1 / corner_hz
        response = (np.sinc(x) * np.exp(-1j * np.pi * x)) ** order
    else:
        corner = 2.0 * np.pi * corner_hz
        design = {"butterworth": signal.butter(order, corner, analog=True),
                  "bessel": signal.bessel(order, corner, analog=True, norm="mag")}[kind]  # fmt: skip
        response = signal.freqs(*design, worN=[angular])[1][0]
    np.testing.assert_allclose(read, (response * np.exp(1j * angular * times_s)).real, atol=2e-6)


def test_lag_is_lag():
    since_s = np.arange(-0.5, 1.5, 1.0 / GRID_HZ)
    times_s = np.linspace(-0.3, 1.4, 500)

    late = RealGauge(lag_s=3e-3).read(np.sin(since_s), since_s, since_s, times_s)

    np.testing.assert_allclose(late, np.sin(times_s - 3e-3), atol=1e-12)


@pytest.mark.parametrize("number", range(len(EFFECTS)), ids=[effect.name for effect in EFFECTS])
def test_every_effect_gives_a_record(number):
    scene, strength, _ = draw_scene(EFFECTS[number], number)
    weak, strong = sorted((EFFECTS[number].weak, EFFECTS[number].strong))

    simulated = simulate(replace(scene, duration_s=2.0))

    assert weak <= abs(strength) <= strong
    assert np.isfinite(simulated.record.table_displacement_m).all()
    assert np.isfinite(simulated.record.relative_displacement_m).all()
    assert simulated.friction_dynamic == pytest.approx(scene.stand.friction_dynamic, rel=0.5)


def test_there_are_sixty_effects_and_the_cache_keeps_records(tmp_path):
    assert len(EFFECTS) > 60
    scene = replace(draw_scene(EFFECTS[1], 1)[0], duration_s=2.0)

    first, again = simulate(scene, tmp_path), simulate(scene, tmp_path)

    assert len(list(tmp_path.iterdir())) == 1
    np.testing.assert_array_equal(first.record.table_displacement_m, again.record.table_displacement_m)
    assert first.friction_dynamic == again.friction_dynamic


def test_the_study_counts_what_it_claims(tmp_path):
    ideal = study_real_stand.run(62 * 3, (0,), tmp_path)
    wrong = replace(ideal, friction=1.02 * ideal.truth, parts="drag_per_m", is_misnamed=True)
    doubted = replace(wrong, adequate=False, degree="none", number=7, slips=2)
    holding = replace(wrong, adequate=False, degree="friction")

    assert ideal.adequate
    assert ideal.is_covered
    assert not ideal.is_silently_wrong
    assert (wrong.is_silently_wrong, doubted.is_silently_wrong, holding.is_silently_wrong) == (
        True,
        False,
        True,
    )
    row = study_real_stand._row("all", [ideal, wrong, doubted])
    assert row[:4] == ("all", "3 (2)", "1 of 2", "1 of 2")
    assert row[6:10] == ("2 of 3", "1 of 3", "0 of 0", "2 of 3")


def test_a_study_is_summarized_from_its_file_as_when_it_ran(tmp_path, monkeypatch, capsys):
    arguments = ["study", "--records", "2", "--workers", "1", "--effect", "ideal"]
    monkeypatch.setattr(sys, "argv", [*arguments, "--csv", str(tmp_path / "outcomes.csv")])
    study_real_stand.main()
    ran = capsys.readouterr().out
    monkeypatch.setattr(sys, "argv", ["study", "--read", str(tmp_path / "outcomes.csv")])

    study_real_stand.main()

    assert capsys.readouterr().out == ran


def test_names_of_effects_are_those_that_the_identification_gives():
    laws = {word for law in (*COMPARED_LAWS, *FALLBACK_LAWS) for word in law.name.split("+")}
    known = {effect.name for effect in stand_parts.EFFECTS} | laws | {"presliding"}

    assert set().union(*(effect.named for effect in EFFECTS)) <= known
