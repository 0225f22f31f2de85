"""Results in words: what is shown, and what is not claimed."""

import pytest
from stage import analysed

from analysis.identification import Degree, ModelSelection
from analysis.laws.stand_parts import EFFECTS
from analysis.one_mass.parts import PARTS
from analysis.quantities import Quantity, ResultWarning
from analysis.verdict_text import EFFECT_TITLES, describe_verdict
from app.acquisition.messages import EndReason
from app.presenters import results
from app.presenters.base import Tone
from messages.message import Message, message


def test_friction_stands_first_with_its_uncertainty() -> None:
    result = results.make_result(analysed(), true_friction=0.1)
    assert (result.headline.symbol, result.headline.value) == ("f<sub>d</sub>", "0.10030")
    assert [(row.symbol, row.value, row.uncertainty_text) for row in result.rows] == [
        ("T", "319.942", "± 0.048\u202fms"),
        ("n<sub>1</sub>", "0.1203", "± 0.0042\u00a01/s"),
    ]
    assert result.fit == "coulomb+tilt explains the record; residual 21\u202fµm, noise 20\u202fµm"
    assert result.comparison == "True value 0.10000: found +0.30\u202f%"
    assert result.model_status.text == "Model fits"


def test_a_model_that_does_not_fit_is_said_so_in_words() -> None:
    bad = ModelSelection("coulomb", False, 4.2e-4, 2.0e-5)
    result = results.make_result(analysed(model=bad))
    assert (result.model_status.text, result.model_status.tone) == ("Model does not fit", Tone.BAD)
    assert result.fit == (
        "No model explains the record (the residual exceeds the noise): f_d cannot be told; "
        "residual 420\u202fµm, noise 20\u202fµm"
    )
    assert result.comparison == ""


def test_friction_that_holds_is_told_from_a_record_that_tells_none() -> None:
    holds = ModelSelection(
        "coulomb", False, 4.2e-4, 2.0e-5, degree=Degree.FRICTION, parts=("arc",), residual_share=0.0025
    )
    warnings = (ResultWarning("arc", Message("the table moves on an arc")), ResultWarning("x", Message("y")))

    result = results.make_result(analysed(model=holds, warnings=warnings))

    assert result.model_status.tone is Tone.WARN
    assert result.fit.startswith("No model explains the record (0.25 % of the swing is left), but f_d holds")
    assert result.about_stand == ("The table moves on an arc",)
    assert result.warnings == ("Y",)


def test_effects_of_the_stand_are_named_in_the_verdict() -> None:
    stand = ModelSelection(
        "coulomb+tilt", True, 2e-5, 2e-5, degree=Degree.STAND, parts=("release-ramp", "film")
    )
    assert str(describe_verdict(stand)) == (
        "coulomb+tilt on a stand with a slow release + a viscous film explains the record"
    )
    assert {effect.name for effect in EFFECTS} | {part.name for part in PARTS} <= set(EFFECT_TITLES)


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
