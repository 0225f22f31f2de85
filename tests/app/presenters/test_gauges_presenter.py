"""The Gauges presenter: calibrations in use, health of live samples, ports, and a new calibration."""

import datetime
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ring_kit import ring_rows
from stage import Call, FakeWorker

from app.acquisition.averaged_counts import MAX_WINDOWS, NoAverageError, RecentSamples, average_counts
from app.acquisition.messages import Connected
from app.acquisition.ring import RingRows
from app.presenters.base import LabelledValue, Progress, Tone
from app.presenters.device_status import DeviceStatus
from app.presenters.gauges.presenter import GaugesPresenter, gauge_cards
from app.presenters.gauges.state import (
    NO_DEVICE,
    ActiveCalibrations,
    CheckForm,
    GaugesState,
    GaugesTab,
    PortCard,
)
from app.presenters.navigator import ConnectForm
from config.files import load_checks, load_gauges
from config.schema import Filter, GaugeCheck, GaugeChecks, Gauges
from drivers.samples import SampleStatus

RATE_HZ = 500.0
NOW = datetime.datetime(2026, 2, 1, 12, 0, tzinfo=datetime.UTC)
GAUGES = load_gauges()


def rows(start_s: float, end_s: float, table_m: float = 0.0, slope: float = 0.0, status: int = 0) -> RingRows:
    """Rows of a table that stands still, or creeps by `slope` (m/s)."""
    number = np.arange(round(start_s * RATE_HZ), round(end_s * RATE_HZ))
    time_s = number / RATE_HZ
    noise = np.random.default_rng(int(number[0])).normal(scale=2e-6, size=(2, len(time_s)))
    table_m = table_m + slope * (time_s - start_s) + noise[0]
    return ring_rows(int(number[0]), time_s, table_m, 1e-3 + noise[1], status)


class Desk:
    """The presenter with all around it."""

    def __init__(self) -> None:
        self.worker = FakeWorker()
        self.prober = FakeWorker()
        self.went: list[Any] = []
        self.presenter = GaugesPresenter(self.worker, self.prober, GAUGES, self, lambda: NOW)  # type: ignore[arg-type]
        self.now_s = 0.0

    def show_start(self) -> None:
        self.went.append("start")

    def fill_connection(self, form: ConnectForm) -> None:
        self.went.append(form)

    def fill_second_port(self, url: str) -> None:
        self.went.append(url)

    def connect_device(self, form: ConnectForm) -> None:
        self.went.append(("connect", form))

    def reconnect(self) -> None:
        self.went.append("again")

    def set_gauges(self, gauges: Gauges) -> None:
        self.went.append(gauges)

    @property
    def state(self) -> GaugesState:
        return self.presenter.state

    @property
    def asked(self) -> list[str]:
        return [call.name for call in self.worker.calls]

    @property
    def last(self) -> Call:
        return self.worker.calls[-1]

    def connect(self, device: str = "GSV-8") -> None:
        self.presenter.on_connecting("COM7")
        self.presenter.on_connected(Connected(device, "1.0", RATE_HZ, "/nowhere"))

    def pass_time(self, seconds: float, **options: Any) -> None:
        """Samples come, a tenth of a second at a time."""
        for _ in range(round(10 * seconds)):
            self.presenter.on_rows(rows(self.now_s, self.now_s + 0.1, **options))
            self.now_s += 0.1
            self.presenter.tick()

    def work(self) -> None:
        """Do for real what was asked for last."""
        call = self.last
        try:
            answer = call.function(*call.arguments)
        except Exception as error:
            call.fail(str(error))
        else:
            call.done(answer)


@pytest.fixture(autouse=True)
def settings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Settings are kept nowhere else."""
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path))
    return tmp_path


@pytest.fixture
def desk() -> Desk:
    return Desk()


# --- calibrations in use ---


def test_an_expired_calibration_stands_out_in_words_and_tone() -> None:
    day = NOW.date()
    for days, tone, words in ((-1, Tone.BAD, "EXPIRED"), (0, Tone.WARN, "today"), (90, Tone.OK, "Valid")):
        until = day + datetime.timedelta(days=days)
        gauges = GAUGES.replace(table=GAUGES.table.replace(valid_until=until))
        card, other = gauge_cards(gauges, GaugeChecks(), day)
        assert card.validity.tone is tone
        assert words in card.validity.text
        assert other.validity.tone is Tone.PLAIN


def test_the_last_check_of_the_calibration_in_use_is_told() -> None:
    def check(passed: bool, gain: float) -> GaugeCheck:
        return GaugeCheck(
            "relative", NOW, passed, 5e-3, 5.2e-3, 5e-5, gain, serial_number=GAUGES.relative.serial_number
        )

    gain = GAUGES.relative.gain_m_per_count
    for made, tone, words in (
        (check(False, gain), Tone.BAD, "FAILED"),
        (check(True, gain), Tone.OK, "passed"),
        (check(False, 2.0 * gain), Tone.PLAIN, "Not checked yet"),
    ):
        _, card = gauge_cards(GAUGES, GaugeChecks((made,)), NOW.date())
        assert card.check.tone is tone
        assert words in card.check.text


def test_what_is_in_use_is_read_whenever_the_screen_is_shown(desk: Desk) -> None:
    desk.presenter.enter()
    assert desk.asked == ["load_calibrations"]
    other = GAUGES.replace(table=GAUGES.table.replace(calibrated_by="A. Berger"))
    desk.last.done(ActiveCalibrations(other, GaugeChecks(), "gauges.toml", "checks.toml: no such key"))
    assert "A. Berger" in [fact.value for fact in desk.state.cards[0].values]
    assert desk.went == [other], "Record takes them too"
    assert desk.state.checks_fault.tone is Tone.BAD


# --- health ---


def test_without_a_connection_it_says_how_to_get_one(desk: Desk) -> None:
    desk.presenter.enter()
    assert "Connect the device" in desk.state.health_note
    desk.presenter.navigator.show_start()
    assert desk.went == ["start"]


def test_live_samples_are_judged_while_the_screen_is_seen(desk: Desk) -> None:
    desk.connect()
    desk.pass_time(2.0)
    assert desk.asked == []
    desk.presenter.enter()
    desk.pass_time(0.2)
    assert desk.asked[-1] == "measure_gauges"
    desk.pass_time(3.0)
    assert len(desk.asked) == 2, "one look at a time"
    desk.work()
    table, relative = desk.state.health
    assert (table.name, str(table.verdict)) == (desk.state.cards[0].name, "good")
    noise = {fact.label: fact.value for fact in table.figures}["noise, rms"]
    assert 1.6 < float(noise.split("\u202f")[0]) < 2.4, "2 um were put in"
    assert {fact.label: fact.value for fact in relative.figures}["reading"].startswith("1.000")
    desk.pass_time(1.0)
    assert len(desk.asked) == 3, "and again after a second"


def test_a_device_that_is_gone_leaves_no_verdict_behind(desk: Desk) -> None:
    desk.presenter.enter()
    desk.connect()
    desk.pass_time(2.0)
    assert desk.asked[-1] == "measure_gauges"
    desk.presenter.on_disconnected()
    desk.work()
    assert desk.state.health == ()


# --- ports ---


def test_ports_are_listed_and_probed_without_sending_unless_asked(desk: Desk) -> None:
    desk.presenter.enter()
    (listing,) = desk.prober.calls
    assert listing.name == "list_port_cards"
    desk.presenter.ports.probe()
    desk.presenter.ports.set_query_silent(True)
    desk.presenter.ports.probe()
    _, probe = desk.prober.calls  # one look at a time
    assert (probe.name, probe.arguments) == ("probe_ports", (False, ""))
    probe.progress(Progress("COM7: listening at 9600 baud"))
    assert desk.presenter.ports.state.progress == "COM7: listening at 9600 baud"
    form = ConnectForm("COM7", "csv", "9600", settings="columns=time_us,value,value")
    cards = (PortCard("COM7", suggested_form=form), PortCard("COM8"))
    probe.done(cards)
    assert desk.presenter.ports.state.ports == cards
    desk.presenter.ports.fill_port("COM8")
    desk.presenter.ports.fill_port("COM7")
    assert desk.went == [form]
    desk.presenter.enter()
    desk.prober.calls[-1].done((PortCard("COM7"), PortCard("COM9")))
    assert desk.presenter.ports.state.ports == (cards[0], PortCard("COM9")), "what was found stays known"


def test_what_was_found_is_connected_as_it_was_found(desk: Desk) -> None:
    desk.presenter.ports.probe()
    form = ConnectForm("COM7", "csv", "9600")
    desk.prober.calls[-1].done((PortCard("COM7", suggested_form=form),))
    desk.presenter.ports.connect("COM8")
    desk.presenter.ports.connect("COM7")
    assert desk.went == [("connect", form)]


def test_looking_can_be_given_up(desk: Desk) -> None:
    desk.presenter.ports.probe()
    desk.presenter.ports.cancel()
    assert desk.prober.cancelled == 1
    desk.prober.calls[-1].cancel()
    assert desk.presenter.ports.state.progress == ""
    assert desk.presenter.ports.state.message.text == "Given up"


# --- live counts ---


def test_counts_are_what_the_device_has_sent() -> None:
    seen = average_counts(rows(0.0, 1.0), 1)
    gauge = GAUGES.relative
    assert seen.counts == pytest.approx(1e-3 / gauge.gain_m_per_count + gauge.zero_count, abs=200.0)


def test_old_samples_are_forgotten_and_bad_ones_not_averaged() -> None:
    recent = RecentSamples(2.0)
    for start in range(6):
        recent.append(rows(start, start + 1.0))
    assert recent.length_s == pytest.approx(3.0, abs=0.01)
    newest = recent.since(5.5)
    assert newest is not None
    assert newest.time_s[0] == 5.5
    assert newest.first_index == 2750
    clipped = rows(0.0, 1.0, status=int(SampleStatus.OVERLOAD_TABLE))
    with pytest.raises(NoAverageError, match="gauge 1 is overloaded"):
        average_counts(clipped, 0)
    assert average_counts(clipped, 1).samples == RATE_HZ


# --- calibrating ---


def test_nothing_is_taken_without_a_device_or_a_number(desk: Desk) -> None:
    desk.presenter.calibration.take_point("1")
    assert desk.presenter.calibration.state.message.text == NO_DEVICE
    desk.presenter.enter()
    desk.connect()
    desk.pass_time(1.0)
    desk.presenter.calibration.take_point("one")
    assert "'one' is not a number of millimetres" in desk.presenter.calibration.state.message.text
    live = float(desk.presenter.calibration.state.live_value)
    assert live == pytest.approx(12000.0, abs=250.0), "the zero in use"


def calibrate_by_hand(desk: Desk, dials_mm: list[float]) -> None:
    """Take readings of a gauge that shows a hundredth too much."""
    for dial_mm in dials_mm:
        desk.pass_time(0.3, table_m=1.01e-3 * dial_mm)
        desk.presenter.calibration.take_point(f"{dial_mm:g}".replace(".", ","))
        desk.pass_time(1.3, table_m=1.01e-3 * dial_mm)
        desk.work()


def test_readings_become_a_calibration_that_is_used(desk: Desk, settings: Path) -> None:
    desk.connect()
    calibrate_by_hand(desk, [0.0, 2.5, 5.0])
    desk.presenter.calibration.undo()
    desk.work()
    assert len(desk.presenter.calibration.state.points) == 2
    calibrate_by_hand(desk, [5.0, 2.5, 0.0, 2.5, 5.0, 2.5, 0.0])
    made = desk.presenter.calibration.state
    assert made.can_save
    assert made.fit is not None
    assert np.abs(made.fit.residual_um).max() < 1.0
    assert made.fit.upward.tolist() == [True] * 3 + [False] * 2 + [True] * 2 + [False] * 2
    assert "repeatability" in [fact.label for fact in made.fit.values]
    kept = list(settings.glob("readings-table-*.csv"))
    assert len(kept) == 1, "readings outlive the window"
    assert kept[0].read_text().count("\n") == 10
    form = made.form
    desk.presenter.calibration.set_form(replace(form, calibrated_by="A. Berger", valid_until="2026-01-31"))
    desk.presenter.calibration.save()
    assert "is past" in desk.presenter.calibration.state.message.text
    form = replace(form, calibrated_by="A. Berger", valid_until="2027-01-31", filter_kind="bessel")
    desk.presenter.calibration.set_form(replace(form, filter_order="4.5", filter_corner_hz="50"))
    desk.presenter.calibration.save()
    assert "The filter cannot be: Expected `int`" in desk.presenter.calibration.state.message.text
    desk.presenter.calibration.set_form(replace(form, filter_order="4", filter_corner_hz="50"))
    desk.presenter.calibration.save()
    assert desk.asked[-1] == "save_calibration"
    desk.work()
    used = load_gauges(settings / "gauges.toml")
    assert used.table.gain_m_per_count == pytest.approx(GAUGES.table.gain_m_per_count / 1.01, rel=1e-4)
    assert (used.table.calibrated_by, used.table.valid_until) == ("A. Berger", datetime.date(2027, 1, 31))
    assert used.table.filter == Filter("bessel", 4, 50.0)
    assert used.relative == GAUGES.relative
    assert desk.presenter.calibration.state.offers_reconnect
    desk.work()
    assert desk.state.cards[0].validity.tone is Tone.OK
    assert LabelledValue("filter", "Bessel, order 4, 50 Hz") in desk.state.cards[0].values
    desk.presenter.navigator.reconnect()
    assert desk.went == [used, "again"]


def test_a_reading_waits_until_the_gauge_stands_still_but_not_for_ever(desk: Desk) -> None:
    desk.connect()
    desk.pass_time(0.5)
    desk.presenter.calibration.take_point("1")
    for _ in range(13):
        desk.presenter.on_rows(rows(desk.now_s, desk.now_s + 0.1, 1e-4 * desk.now_s, 1e-4))
        desk.now_s += 0.1
        desk.presenter.tick()
    assert desk.presenter.calibration.state.reading_status.startswith("Still moving by")
    assert desk.presenter.calibration.state.points == ()
    for _ in range(round(11 * MAX_WINDOWS)):
        desk.presenter.on_rows(rows(desk.now_s, desk.now_s + 0.1, 1e-4 * desk.now_s, 1e-4))
        desk.now_s += 0.1
        desk.presenter.tick()
    assert len(desk.presenter.calibration.state.points) == 1
    assert "still creeping" in desk.presenter.calibration.state.message.text


def test_a_reading_can_be_left_and_does_not_outlive_its_device(desk: Desk) -> None:
    desk.connect()
    desk.pass_time(0.5)
    desk.presenter.calibration.take_point("1")
    desk.presenter.calibration.undo()
    desk.pass_time(2.0)
    assert desk.presenter.calibration.state.points == ()
    desk.presenter.calibration.take_point("1")
    desk.presenter.on_disconnected()
    assert "was not taken" in desk.presenter.calibration.state.message.text
    assert desk.presenter.calibration.state.reading_status == ""


def test_an_overloaded_gauge_gives_no_reading(desk: Desk) -> None:
    desk.connect()
    desk.pass_time(0.5)
    desk.presenter.calibration.take_point("1")
    desk.pass_time(1.5, status=int(SampleStatus.OVERLOAD_TABLE))
    assert desk.presenter.calibration.state.points == ()
    assert "overloaded" in desk.presenter.calibration.state.message.text


def test_the_gauge_stays_while_there_are_readings_of_it(desk: Desk) -> None:
    desk.connect()
    calibrate_by_hand(desk, [0.0])
    form = desk.presenter.calibration.state.form
    desk.presenter.calibration.set_form(replace(form, gauge=1))
    assert desk.presenter.calibration.state.form.gauge == 0
    desk.presenter.calibration.restart()
    desk.presenter.calibration.set_form(replace(form, gauge=1))
    assert desk.presenter.calibration.state.form.gauge == 1


def test_another_dial_or_curve_is_fitted_anew_and_rubbish_is_said(desk: Desk) -> None:
    desk.connect()
    calibrate_by_hand(desk, [0.0])
    form = desk.presenter.calibration.state.form
    desk.presenter.calibration.set_form(replace(form, degree=2, uncertainty_mm="0,002"))
    assert desk.asked[-1] == "fit_calibration"
    (fit,) = desk.last.arguments
    assert fit.degree == 2
    assert fit.uncertainty_m == pytest.approx(2e-6)
    desk.presenter.calibration.set_form(replace(form, resolution_mm="fine"))
    assert "Resolution of the dial 'fine'" in desk.presenter.calibration.state.message.text


def test_what_went_wrong_while_saving_is_said(desk: Desk) -> None:
    desk.connect()
    calibrate_by_hand(desk, [0.0, 2.5, 5.0])
    desk.presenter.calibration.save()
    desk.last.fail("gauges.toml: cannot be written (no space left)")
    assert desk.presenter.calibration.state.message.tone is Tone.BAD
    desk.presenter.calibration.save()
    desk.last.done(("new.toml", "old.toml"))
    assert "old.toml" in desk.presenter.calibration.state.message.text


def test_the_tab_is_kept(desk: Desk) -> None:
    desk.presenter.set_tab(GaugesTab.PORTS)
    assert desk.state.tab is GaugesTab.PORTS
    desk.presenter.close()
    assert desk.worker.closed
    assert desk.prober.closed


# --- a check against what is known ---


def check_form(**changes: Any) -> CheckForm:
    return CheckForm(**{"known": "10", "uncertainty": "0,005", "reference": " gauge block ", **changes})


def fill_in_check(desk: Desk, table_m: float = 0.0, **changes: Any) -> None:
    """Connect, and fill in what a check needs; the gauge rests at `table_m`."""
    desk.connect()
    desk.presenter.enter()
    desk.pass_time(0.5, table_m=table_m)
    desk.presenter.check.set_form(check_form(**changes))


def start_check(desk: Desk) -> None:
    """Begin a check up to the first reading, which waits for rest."""
    fill_in_check(desk)
    desk.presenter.check.advance()
    desk.presenter.check.advance()


def run_check(desk: Desk, moved_m: float, **changes: Any) -> None:
    """The operator's part of a check: at rest at 1 mm, then `moved_m` further."""
    desk.presenter.set_tab(GaugesTab.CHECK)
    fill_in_check(desk, 1e-3, **changes)
    desk.presenter.check.advance()
    assert "rest" in desk.presenter.check.state.instruction
    desk.presenter.check.advance()
    desk.pass_time(1.5, table_m=1e-3)
    assert "+10" in desk.presenter.check.state.instruction
    desk.presenter.check.advance()
    desk.pass_time(1.5, table_m=1e-3 + moved_m)
    assert desk.asked[-1] == "check_gauge"
    desk.work()


@pytest.mark.parametrize(("moved_m", "passed"), [(10.005e-3, True), (10.5e-3, False)])
def test_a_gauge_is_checked_and_the_verdict_kept(desk: Desk, moved_m: float, passed: bool) -> None:
    run_check(desk, moved_m)
    check = desk.presenter.check.state
    assert check.outcome.tone is (Tone.OK if passed else Tone.BAD)
    facts = {fact.label: fact.value for fact in check.values}
    assert facts["known"] == "10.0000\u202fmm"
    assert float(facts["measured"].split("\u202f")[0]) == pytest.approx(moved_m * 1e3, abs=1e-3)
    assert any("calibrate it again" in caution for caution in check.warnings) is not passed
    (kept,) = load_checks().check
    assert (kept.gauge, kept.passed, kept.reference) == ("table", passed, "gauge block")
    assert kept.device == "GSV-8"
    assert kept.measured_m == pytest.approx(moved_m, abs=1e-6)
    assert desk.asked[-1] == "load_calibrations", "the cards tell it too"
    assert not check.is_started


def test_a_check_waits_for_a_gauge_that_stands_still(desk: Desk) -> None:
    start_check(desk)
    for step in range(15):
        desk.pass_time(0.1, table_m=1e-4 * step)
    assert "Still moving" in desk.presenter.check.state.reading_status
    desk.presenter.check.set_form(check_form(known="3"))
    assert desk.presenter.check.state.form.known == "10.0", "what is checked is fixed meanwhile"
    desk.presenter.check.cancel()
    assert "nothing is kept" in desk.presenter.check.state.message.text
    assert not desk.presenter.check.state.is_started
    assert load_checks().check == ()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"known": ""}, "Say how far the gauge is moved"),
        ({"known": "0"}, "Say how far the gauge is moved"),
        ({"known": "ten"}, "Known 'ten' is not a number"),
        ({"uncertainty": "-1"}, "is below 0"),
    ],
)
def test_what_cannot_be_checked_is_said(desk: Desk, changes: dict[str, str], said: str) -> None:
    desk.connect()
    desk.presenter.check.set_form(check_form(**changes))
    desk.presenter.check.advance()
    assert said in desk.presenter.check.state.message.text
    assert not desk.presenter.check.state.is_started


def test_a_check_needs_a_device_that_stays(desk: Desk) -> None:
    desk.presenter.check.advance()
    assert desk.presenter.check.state.message.text == NO_DEVICE
    desk.connect()
    desk.presenter.check.set_form(check_form())
    desk.presenter.check.advance()
    desk.presenter.on_disconnected()
    assert "connection is gone" in desk.presenter.check.state.message.text
    assert not desk.presenter.check.state.is_started


# --- a device that is lost ---


LOST = DeviceStatus("GSV-8", "14:03:21")
LIVE = DeviceStatus("GSV-8")


def test_a_lost_device_ends_an_average_and_dates_what_is_shown(desk: Desk) -> None:
    desk.connect()
    desk.presenter.enter()
    desk.pass_time(2.0)
    desk.work()
    live = desk.presenter.calibration.state.live_value
    desk.presenter.calibration.take_point("1")
    desk.presenter.on_device_status(LOST)
    calibration = desk.presenter.calibration.state
    assert (calibration.live_value, calibration.stopped_at) == (live, "14:03:21")
    assert calibration.reading_status == ""
    assert calibration.message.text == "No sample came after 14:03:21: the reading was not taken"
    assert desk.state.health != ()
    assert desk.state.stopped_at == desk.presenter.check.state.stopped_at == "14:03:21"
    desk.presenter.calibration.take_point("1")
    assert "since 14:03:21" in desk.presenter.calibration.state.message.text
    assert desk.presenter.calibration.state.reading_status == ""


def test_a_device_lost_before_its_gauges_were_looked_at_is_told(desk: Desk) -> None:
    desk.connect()
    assert "let the stand rest" in desk.state.health_note
    desk.presenter.on_device_status(LOST)
    desk.presenter.enter()
    assert desk.state.health_note == "No sample has come since 14:03:21: look at device and cable"
    desk.presenter.on_device_status(LIVE)
    assert "let the stand rest" in desk.state.health_note


def test_samples_before_and_after_a_loss_are_not_averaged_together(desk: Desk) -> None:
    desk.connect()
    desk.presenter.enter()
    desk.pass_time(1.0)
    desk.presenter.on_device_status(LOST)
    desk.presenter.on_device_status(LIVE)
    assert desk.presenter.calibration.state.stopped_at == ""
    desk.presenter.calibration.take_point("1")
    assert desk.presenter.calibration.state.message.text == NO_DEVICE, "no sample has come since"
    desk.pass_time(0.3)
    desk.presenter.calibration.take_point("1")
    desk.pass_time(1.3)
    assert len(desk.presenter.calibration.state.points) == 1


def test_a_calibration_is_not_saved_without_the_device_of_its_readings(desk: Desk) -> None:
    desk.connect()
    calibrate_by_hand(desk, [0.0, 2.5, 5.0])
    calibration = desk.presenter.calibration
    assert calibration.state.can_save
    desk.presenter.on_device_status(LOST)
    calibration.save()
    assert desk.asked[-1] == "fit_calibration"
    assert calibration.state.message.text.startswith("Not saved: GSV-8, which these readings are of, sends")
    assert "readings-table-" in calibration.state.message.text
    desk.presenter.on_disconnected()
    calibration.save()
    assert desk.asked[-1] == "fit_calibration"
    desk.connect("HX711")
    desk.presenter.on_device_status(DeviceStatus("HX711"))
    calibration.save()
    assert desk.asked[-1] == "fit_calibration"
    desk.pass_time(1.0)
    calibration.take_point("1")
    assert calibration.state.message.text == (
        "The readings before are of GSV-8: start over to calibrate with HX711"
    )
    desk.presenter.on_disconnected()
    desk.connect()
    calibration.save()
    assert desk.asked[-1] == "save_calibration"


def test_a_lost_device_breaks_a_check_off(desk: Desk) -> None:
    start_check(desk)
    desk.pass_time(1.5)
    assert "+10" in desk.presenter.check.state.instruction, "the reading at rest is taken"
    desk.presenter.on_device_status(LOST)
    assert desk.presenter.check.state.message.text == (
        "No sample came after 14:03:21: the check is broken off, and nothing is kept"
    )
    assert not desk.presenter.check.state.is_started
    desk.presenter.check.advance()
    assert "since 14:03:21" in desk.presenter.check.state.message.text
    assert not desk.presenter.check.state.is_started


def test_a_check_whose_readings_are_taken_outlives_its_device(desk: Desk) -> None:
    desk.presenter.set_tab(GaugesTab.CHECK)
    fill_in_check(desk)
    for table_m in (0.0, 10e-3):
        desk.presenter.check.advance()
        desk.presenter.check.advance()
        desk.pass_time(1.5, table_m=table_m)
    desk.presenter.on_device_status(LOST)
    desk.presenter.on_disconnected()
    desk.work()
    assert desk.presenter.check.state.outcome.tone is Tone.OK


def test_a_port_can_be_that_of_gauge_2(desk: Desk) -> None:
    desk.presenter.ports.fill_second_port("COM8")
    assert desk.went == ["COM8"]
