"""Compiles the numerical code once, so that nobody waits for it later."""

from analysis.classical_estimates import estimate_classically
from analysis.identify import identify, warm_up
from analysis.laws.stand_parts import stand_displacements
from analysis.synthetic import Truth, simulate_record
from drivers.registry import AVAILABLE


def compile_all() -> None:
    """Identify a stand that is not ideal, and one by the law that is compiled apart; decode each protocol.

    A record that no law on an ideal stand explains has all laws and effects of the stand tried.
    """
    warm_up()
    truth = Truth(rate_hz=300.0, duration_s=6.0, tilt_rad=1e-3)
    effects = {"release_ramp_s": 0.011, "film_s_per_m": 1.0}
    motion = stand_displacements(truth.parameters(), effects, truth.duration_s + 1e-3)
    identify(simulate_record(truth, motion))
    estimate_classically(simulate_record(truth), identify(simulate_record(truth), model="stribeck+tilt"))
    for driver in AVAILABLE:
        driver.make_source({}, 500.0).prepare()
