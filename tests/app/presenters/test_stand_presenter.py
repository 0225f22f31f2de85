"""The Simulated stand presenter: options, faults on demand, truth."""

from dataclasses import replace

import pytest
from stage import FakeSimulation

from app.presenters.base import EMPTY_CHIP, Tone
from app.presenters.stand_screen import StandForm, StandPresenter, stand_options
from app.simulated_stand.options import Gesture, SimulatedStandOptions

BASE = SimulatedStandOptions(decay_s=30.0, seed=1)


class Desk:
    def __init__(self) -> None:
        self.opened: list[SimulatedStandOptions] = []
        self.stand: FakeSimulation | None = None
        self.presenter = StandPresenter(BASE, ("1FFM0", "2SSM1"), self.opened.append, lambda: self.stand)

    def pass_ticks(self) -> None:
        for _ in range(40):
            self.presenter.tick()


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_empty_fields_take_what_is_usual_and_say_what_that_is(desk: Desk) -> None:
    usual = desk.presenter.state.defaults
    assert (usual.noise_um, usual.rate_hz, usual.tilt_mrad) == ("20", "2000", "0")
    before = usual.friction
    desk.presenter.set_form(StandForm("2SSM1"))
    assert desk.presenter.state.defaults.friction != before
    desk.presenter.start()
    assert desk.opened == [SimulatedStandOptions(decay_s=30.0, seed=1, series="2SSM1")]


def test_what_is_filled_in_becomes_the_stand() -> None:
    form = StandForm("1FFM0", "0,12", "-1.5", "5", "1000", "1", "0.5", "release-ramp=0,01, film=0.5")
    assert stand_options(form, BASE) == SimulatedStandOptions(
        decay_s=30.0,
        seed=1,
        friction=0.12,
        tilt_rad=-1.5e-3,
        noise_m=5e-6,
        rate_hz=1000.0,
        drop=0.01,
        flip=0.005,
        effects={"release-ramp": 0.01, "film": 0.5},
    )


@pytest.mark.parametrize(
    ("form", "words"),
    [
        (StandForm("1FFM0", friction="much"), "Friction 'much' is not a number"),
        (StandForm("1FFM0", friction="3"), "out of range"),
        (StandForm("1FFM0", drop_percent="101"), "out of range"),
        (StandForm("1FFM0", effects="ramp=0.01"), "'ramp' is not known: choose from release-ramp"),
        (StandForm("1FFM0", effects="film"), "Effect film '' is not a number"),
    ],
)
def test_what_cannot_be_is_said_and_nothing_starts(desk: Desk, form: StandForm, words: str) -> None:
    desk.presenter.set_form(form)
    desk.presenter.start()
    assert words in desk.presenter.state.message.text
    assert desk.opened == []
    desk.presenter.set_form(replace(form, friction="0.1", drop_percent="", effects=""))
    assert desk.presenter.state.message == EMPTY_CHIP


def test_the_start_page_gets_a_stand_without_what_is_filled_in_here(desk: Desk) -> None:
    desk.presenter.set_form(StandForm("1FFM0", drop_percent="50"))
    assert desk.presenter.select_series("2SSM1").drop == 0.0
    assert desk.presenter.state.form.series == "2SSM1"


def test_faults_happen_while_it_runs_and_the_truth_tells_of_them(desk: Desk) -> None:
    desk.presenter.inject_fault("stall")
    assert desk.presenter.state.message.tone is Tone.WARN
    desk.stand = FakeSimulation(BASE)
    desk.pass_ticks()
    assert desk.presenter.state.is_running
    facts = {fact.label: fact.value for fact in desk.presenter.state.truth}
    assert facts["damaged, lost"] == "7, 0"
    assert facts["slip of a release"] == "10.100\u202fmm"
    desk.presenter.set_fault_duration("1,5")
    desk.presenter.inject_fault("unplug")
    desk.presenter.set_fault_duration("-5")
    desk.presenter.inject_fault("jump")
    assert desk.stand.disturbed == ["unplug 1.5", "jump -5"]
    desk.presenter.inject_fault("stall")
    assert "positive number of seconds" in desk.presenter.state.message.text
    desk.pass_ticks()
    assert desk.presenter.state.disturbances == (
        "jump, \u22125\u202fs, at 4.0\u202fs",
        "unplug, 1.5\u202fs, at 3.0\u202fs",
    )
    desk.stand = None
    desk.pass_ticks()
    assert not desk.presenter.state.is_running
    assert desk.presenter.state.truth == ()


def test_the_next_pull_is_let_go_early_where_that_is_asked_for(desk: Desk) -> None:
    desk.stand = FakeSimulation(BASE)
    desk.presenter.inject_fault(Gesture.EARLY)
    assert desk.stand.asked == [Gesture.EARLY]
    assert desk.presenter.state.message.text == "The next pull is let go too early"
