"""Effects of the stand over several runs: whose they are, and how large."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from analysis.campaign.campaign import summarize
from analysis.campaign.stand_effects import EffectScope, summarize_effects
from tests.campaign_kit import friction_run
from tests.effects_kit import NOISE_M, effect_run, mode


def runs_with(*shown, **fields):
    return [effect_run(f"/runs/{number}.h5", one, **fields) for number, one in enumerate(shown, 1)]


def ramps(*times_s):
    return [{"release-ramp": (time_s,)} if time_s else {} for time_s in times_s]


def test_a_mode_of_every_run_is_the_stands_and_its_size_is_pooled():
    sizes = (0.0190, 0.0192, 0.0188, 0.0190)
    (found,) = summarize_effects(runs_with(*(mode(mass_share=size) for size in sizes)))
    pooled = found.sizes["second_mode_mass_share"]
    weights = 1.0 / np.array(sizes) ** 2

    assert (found.name, found.scope, found.run_count) == ("second-mode", EffectScope.STAND, 4)
    assert found.deviating == ()
    assert pooled.quantity.value == pytest.approx(np.average(sizes, weights=weights), rel=1e-9)
    # repeats reduce the runs' own part only, the gain of the gauge they share
    assert pooled.repeatable == pytest.approx(0.02 * 0.75**0.5 * 0.019 / 4**0.5, rel=0.01)
    assert pooled.quantity.standard_uncertainty == pytest.approx(
        np.hypot(pooled.repeatable, 0.01 * 0.019), rel=0.01
    )
    assert str(found.message) == (
        "4 of 4 runs: a second mode at 8.20 ± 0.11 Hz, of 1.900 ± 0.025 % of the table's mass:"
        " tighten what is mounted."
    )


def test_a_long_release_is_that_of_its_run():
    (found,) = summarize_effects(runs_with(*ramps(0, 0, 0.031, 0)))

    assert (found.scope, found.runs, found.run_count) == (EffectScope.RUNS, ("/runs/3.h5",), 4)
    assert str(found.message) == ("1 of 4 runs (3.h5): the release took 31.00 ± 0.62 ms: use a sharper hook.")


def test_releases_that_scatter_are_told_by_their_range():
    (found,) = summarize_effects(runs_with(*ramps(0.008, 0.0311, 0, 0.015)))

    assert found.scope is EffectScope.RUNS
    assert "3 of 4 runs (1.h5, 2.h5, 4.h5): the release took 8 to 31.1 ms" in str(found.message)


def test_hardening_is_pooled_at_the_largest_pullback():
    """The springs' cubic force is the stand's: at half the pullback they harden by a quarter."""
    deep = runs_with({"spring-hardening": (0.04,)}, {"spring-hardening": (0.0404,)})
    flat = [effect_run("/runs/flat.h5", {"spring-hardening": (0.01,)}, pullback_m=0.006)]
    (found,) = summarize_effects(deep + flat)

    assert found.scope is EffectScope.STAND
    assert found.sizes["spring_hardening"].quantity.value == pytest.approx(0.0401, rel=0.01)
    assert found.pullback_m == 0.012
    assert "3 of 3 runs, at a pullback of 12.0 mm: the springs harden by 4.0" in str(found.message)


def test_a_run_without_the_mode_that_the_others_show_is_named():
    (found,) = summarize_effects(runs_with(mode(), {}, mode(), mode()))

    assert (found.scope, found.run_count, found.deviating) == (EffectScope.STAND, 4, ("/runs/2.h5",))
    assert str(found.message).endswith("tighten what is mounted. Not so in 2.h5.")


def test_a_run_too_noisy_to_show_the_mode_does_not_count():
    noisy = effect_run("/runs/noisy.h5", {}, noise_m=20.0 * NOISE_M)
    (found,) = summarize_effects([*runs_with(mode(), mode(), mode()), noisy])

    assert (found.run_count, found.deviating) == (3, ())


def test_a_short_pull_hides_hardening_but_no_mode():
    short = effect_run("/runs/short.h5", {}, pullback_m=0.003)
    (hardening,) = summarize_effects([*runs_with(*[{"spring-hardening": (0.02,)}] * 3), short])
    (second_mode,) = summarize_effects([*runs_with(mode(), mode(), mode()), short])

    assert (hardening.run_count, second_mode.run_count) == (3, 4)


def test_runs_in_which_no_effects_were_looked_for_or_no_model_fits_do_not_count():
    unsearched = effect_run("/runs/old.h5", {}, effects=None)
    unexplained = effect_run("/runs/none.h5", {}, adequate=False)
    (found,) = summarize_effects([*runs_with(mode(), mode()), unsearched, unexplained])

    assert (found.run_count, found.scope) == (2, EffectScope.STAND)


def test_an_effect_in_a_model_that_explains_too_little_counts_only_where_it_is_named():
    named = effect_run("/runs/named.h5", mode(), adequate=False)
    unnamed = effect_run("/runs/unnamed.h5", mode(), adequate=False, warnings=())
    faint = effect_run("/runs/faint.h5", mode(), warnings=())
    (found,) = summarize_effects([named, unnamed, faint])

    assert found.runs == ("/runs/named.h5", "/runs/faint.h5")
    assert summarize_effects([unnamed, faint]) == ()


def test_a_size_far_from_the_others_is_left_out_and_named():
    sizes = (0.020, 0.0202, 0.0199, 0.0201, 0.05, 0.0198)
    (found,) = summarize_effects(runs_with(*(mode(mass_share=size) for size in sizes)))

    assert (found.scope, found.deviating) == (EffectScope.STAND, ("/runs/5.h5",))
    assert found.sizes["second_mode_mass_share"].quantity.value == pytest.approx(0.02, rel=0.01)
    assert found.sizes["second_mode_mass_share"].runs == 5


def test_modes_of_different_frequencies_are_not_one_mode_of_the_stand():
    (found,) = summarize_effects(runs_with(*(mode(frequency_hz=value) for value in (6.0, 9.0, 14.0, 20.0))))

    assert found.scope is EffectScope.RUNS
    assert "a second mode at 6 to 20 Hz" in str(found.message)


def test_one_run_leaves_open_whose_an_effect_is():
    (found,) = summarize_effects(runs_with(mode()))

    assert found.scope is EffectScope.OPEN
    assert str(found.message).endswith("More runs will tell whether it is the stand's.")


def test_friction_is_judged_by_contact():
    oiled = runs_with(*[{"film": (0.5,)}] * 3, series="1SSLM0")
    dry = [effect_run(f"/runs/dry{number}.h5", {}) for number in range(3)]
    (found,) = summarize_effects(oiled + dry)

    assert (found.scope, found.contact, found.run_count) == (EffectScope.CONTACT, "SSL", 3)
    assert str(found.message).startswith("3 of 3 runs of contact SSL: friction rises with the sliding")


def test_effects_of_the_stand_come_first():
    found = summarize_effects(runs_with(mode() | {"release-ramp": (0.02,)}, mode(), mode()))

    assert [one.name for one in found] == ["second-mode", "release-ramp"]


@pytest.mark.parametrize(("count", "all_runs"), [(6, 6), (3, 4), (1, 9)])
def test_interval_of_the_share_is_that_of_clopper_and_pearson(count, all_runs):
    shown = [mode()] * count + [{}] * (all_runs - count)
    (found,) = summarize_effects(runs_with(*shown))
    expected = binomtest(count, all_runs).proportion_ci(0.95, "exact")

    assert found.share_95 == pytest.approx((expected.low, expected.high), abs=1e-9)


def test_the_larger_bend_of_a_gauge_is_told():
    (found,) = summarize_effects(runs_with(*[{"gauge-1-bend": (-0.002, 0.011)}] * 3))

    assert "gauge 1 is bent by 1.100 ± 0.016 % at the pullback" in str(found.message)


def test_clean_campaigns_and_excluded_runs_say_nothing():
    clean = [friction_run(f"{number}", "1FFM0", 0.1) for number in range(3)]
    excluded = replace(effect_run("odd", mode()), excluded="bumped")

    assert summarize_effects(clean) == ()
    assert summarize_effects([]) == ()
    assert summarize([*clean, excluded]).effects_of_stand == ()


def test_effects_are_part_of_a_campaign():
    (found,) = summarize(runs_with(mode(), mode())).effects_of_stand

    assert found.name == "second-mode"
