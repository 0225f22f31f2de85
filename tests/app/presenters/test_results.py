"""Results in words: what is shown, and what is not claimed."""

import numpy as np
import pytest
from stage import analysed

from analysis.identification import Events, ModelVerdict
from analysis.quantities import Quantity
from app.acquisition.messages import EndReason
from app.presenters import results
from app.presenters.identify.presenter import IdentifyPresenter
from app.presenters.screen import Progress, Tone


def test_friction_stands_first_with_its_uncertainty() -> None:
    result = results.describe(analysed(), true_friction=0.1)
    assert (result.headline.symbol, result.headline.value) == ("f<sub>d</sub>", "0.10030")
    assert [(row.symbol, row.value, row.spread) for row in result.rows] == [
        ("T", "319.942", "± 0.048\u202fms"),
        ("n<sub>1</sub>", "0.1203", "± 0.0042\u00a01/s"),
    ]
    assert result.fit == "coulomb+tilt, residual 21\u202fµm, noise 20\u202fµm"
    assert result.comparison == "True value 0.10000: found +0.30\u202f%"
    assert result.verdict.text == "Model fits"


def test_a_model_that_does_not_fit_is_said_so_in_words() -> None:
    bad = ModelVerdict("coulomb", False, 4.2e-4, 2.0e-5)
    result = results.describe(analysed(model=bad))
    assert (result.verdict.text, result.verdict.tone) == ("Model does not fit", Tone.BAD)
    assert result.fit == "coulomb, residual 420\u202fµm, noise 20\u202fµm"
    assert result.comparison == ""


def test_without_slip_the_bound_of_static_friction_takes_the_first_place() -> None:
    bound = {"friction_static_lower": Quantity(0.47, 0.002, (0.466, 0.474), "1")}
    result = results.describe(analysed(results=bound, model=None), true_friction=0.1)
    assert (result.headline.symbol, result.headline.value) == ("f<sub>s</sub> ≥", "0.4700")
    assert result.verdict.text == "No motion to fit"
    assert result.comparison == ""


def test_what_was_not_determined_gets_no_number() -> None:
    result = results.describe(analysed(results={}, model=None))
    assert (result.headline.value, result.headline.spread) == ("not determined", "")
    assert result.rows == ()


@pytest.mark.parametrize("reason", list(EndReason))
def test_every_end_of_a_recording_has_its_words(reason: EndReason) -> None:
    assert results.ending(reason.value).text.startswith(("Ended", "Stopped"))
    assert reason.value not in results.ending(reason.value).text or "-" not in reason.value


def test_all_rows_hold_every_quantity_that_was_found_once() -> None:
    rows = results.all_rows(analysed())
    assert [row.word for row in rows] == [
        "dynamic friction",
        "period",
        "damping",
        "static friction, at most",
        "tilt",
        "pullback",
        "residual displacement",
        "MSK-64 degree",
    ]


def identify() -> IdentifyPresenter:
    presenter = IdentifyPresenter(lambda: None, lambda _: None)
    presenter.opening(str(analysed().path))
    return presenter


def test_curves_begin_at_release_with_slip_marked_and_residual_in_micrometres() -> None:
    presenter = identify()
    run = analysed()
    presenter.show_run(run)
    curves = presenter.state.curves
    assert curves is not None
    assert curves.time_s[0] == pytest.approx(-4.0)
    assert curves.slip == pytest.approx((0.0, 2.5))
    assert curves.noise_um == pytest.approx(20.0)
    assert curves.relative is not None
    assert curves.relative.residual_um is not None
    assert np.std(curves.relative.residual_um) == pytest.approx(20.0, rel=0.05)
    np.testing.assert_allclose(curves.table.record_mm, 1e3 * run.table.record_m)


def test_slip_to_the_end_is_marked_to_the_end_and_none_where_nothing_slips() -> None:
    presenter = identify()
    presenter.show_run(analysed(events=Events(5.0, None, None)))
    assert presenter.state.curves is not None
    assert presenter.state.curves.slip == pytest.approx((0.0, 9.999))
    presenter.show_run(analysed(results={}))
    assert presenter.state.curves.slip is None


def test_a_record_without_release_is_drawn_from_its_start() -> None:
    presenter = identify()
    presenter.show_run(analysed(events=Events(), model=None, relative=None))
    curves = presenter.state.curves
    assert curves is not None
    assert (curves.time_s[0], curves.slip, curves.noise_um, curves.relative) == (0.0, None, None, None)


def test_the_likeliest_model_stands_first_and_the_chosen_one_is_marked() -> None:
    presenter = identify()
    presenter.show_run(analysed())
    assert [(row.name, row.bic, row.chosen) for row in presenter.state.models] == [
        ("coulomb+tilt", "best", True),
        ("coulomb", "+110", False),
    ]


def test_only_the_run_that_was_asked_for_is_shown() -> None:
    presenter = identify()
    other = "/recordings/other.h5"
    presenter.working(other, Progress("Fitting", 0.5))
    presenter.show_failure(other, "no")
    presenter.show_run(analysed(path=other))
    assert presenter.state.curves is None
    assert presenter.state.progress == Progress("Reading the run")
    presenter.show_failure(str(analysed().path), "it is no run. Choose another")
    assert presenter.state.failure == "it is no run. Choose another"
    assert presenter.state.progress is None


def test_opening_another_run_takes_the_old_one_away() -> None:
    presenter = identify()
    presenter.show_run(analysed())
    presenter.opening("/recordings/b.h5")
    assert presenter.state.curves is None
    assert presenter.state.title == "b.h5"


def test_cancelling_is_possible_only_while_something_goes_on() -> None:
    cancelled = []
    presenter = IdentifyPresenter(lambda: cancelled.append(1), lambda _: None)
    presenter.cancel()
    assert not cancelled
    presenter.opening("/recordings/a.h5")
    presenter.cancel()
    assert len(cancelled) == 1
