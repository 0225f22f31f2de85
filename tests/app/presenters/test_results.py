"""Results in words: what is shown, and what is not claimed."""

import pytest
from stage import analysed

from analysis.identification import ModelSelection
from analysis.quantities import Quantity, ResultWarning
from app.acquisition.messages import EndReason
from app.presenters import results
from app.presenters.base import Tone
from messages.message import message


def test_friction_stands_first_with_its_uncertainty() -> None:
    result = results.make_result(analysed(), true_friction=0.1)
    assert (result.headline.symbol, result.headline.value) == ("f<sub>d</sub>", "0.10030")
    assert [(row.symbol, row.value, row.uncertainty_text) for row in result.rows] == [
        ("T", "319.942", "± 0.048\u202fms"),
        ("n<sub>1</sub>", "0.1203", "± 0.0042\u00a01/s"),
    ]
    assert result.fit == "coulomb+tilt, residual 21\u202fµm, noise 20\u202fµm"
    assert result.comparison == "True value 0.10000: found +0.30\u202f%"
    assert result.model_status.text == "Model fits"


def test_a_model_that_does_not_fit_is_said_so_in_words() -> None:
    bad = ModelSelection("coulomb", False, 4.2e-4, 2.0e-5)
    result = results.make_result(analysed(model=bad))
    assert (result.model_status.text, result.model_status.tone) == ("Model does not fit", Tone.BAD)
    assert result.fit == "coulomb, residual 420\u202fµm, noise 20\u202fµm"
    assert result.comparison == ""


def test_without_slip_the_bound_of_static_friction_takes_the_first_place() -> None:
    bound = {"friction_static_lower": Quantity(0.47, 0.002, (0.466, 0.474), "1")}
    result = results.make_result(analysed(results=bound, model=None), true_friction=0.1)
    assert (result.headline.symbol, result.headline.value) == ("f<sub>s</sub> ≥", "0.4700")
    assert result.model_status.text == "No motion to fit"
    assert result.comparison == ""


def test_what_was_not_determined_gets_no_number() -> None:
    result = results.make_result(analysed(results={}, model=None))
    assert (result.headline.value, result.headline.uncertainty_text) == ("not determined", "")
    assert result.rows == ()


@pytest.mark.parametrize("reason", list(EndReason))
def test_every_end_of_a_recording_has_its_words(reason: EndReason) -> None:
    assert results.end_status(reason.value).text.startswith(("Ended", "Stopped"))
    assert reason.value not in results.end_status(reason.value).text or "-" not in reason.value


def test_all_rows_hold_every_quantity_that_was_found_once() -> None:
    rows = results.all_rows(analysed())
    assert [row.name for row in rows] == [
        "dynamic friction",
        "period",
        "damping",
        "static friction, at most",
        "tilt",
        "pullback",
        "residual displacement",
        "MSK-64 degree",
    ]


def test_a_free_decay_of_one_mass_is_headed_by_its_period() -> None:
    result = results.make_result(analysed(kind="one-mass"))
    assert (result.headline.symbol, result.headline.value) == ("T", "319.942")


def test_a_caution_says_what_to_do_and_says_it_once() -> None:
    said = (
        ResultWarning("spikes", message("3 readings are left out.")),
        ResultWarning("no-slip", message("nothing slips.")),
    )
    assert results.make_result(analysed(warnings=said)).warnings == (
        "3 readings are left out. Check the cables for loose contacts.",
        "Nothing slips.",
    )


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (
            "the table was let down. released twice. the tail is short",
            "The table was let down. Released twice. The tail is short",
        ),
        ("it is full: 2 of 3. however, it counts", "It is full: 2 of 3. However, it counts"),
        (
            "run.h5: cannot be read. `slipstand doctor` helps",
            "run.h5: cannot be read. `slipstand doctor` helps",
        ),
        (
            "another file, e.g. one of 1.5 s. f_d is unknown",
            "Another file, e.g. one of 1.5 s. f_d is unknown",
        ),
    ],
)
def test_every_sentence_begins_with_a_capital_letter_and_no_name_is_changed(said: str, shown: str) -> None:
    assert results.sentence(said) == shown
