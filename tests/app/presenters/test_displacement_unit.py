"""Displacements on screens in mm or µm: one choice for live values, guidance, results and curves."""

import time
from collections.abc import Iterator

import numpy as np
import pytest
from stage import FakeRecorder, FakeWorker, analysed, bench, rows_between, standing

from analysis.catalogue import (
    DISPLACEMENT_UNITS,
    MICROMETRE,
    MILLIMETRE,
    Place,
    definition,
    displacement_unit,
    use_displacement_unit,
)
from app.acquisition.messages import Connected, PullbackState, StateChanged
from app.presenters import number_text, results
from app.presenters.analysed_run import Kinematics
from app.presenters.identify import plot_data
from app.presenters.identify.state import PlotTab
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import Action, Connecting
from app.presenters.settings_screen import CHOICES
from app.presenters.worker import LazyFunction, Worker


@pytest.fixture
def micrometres() -> Iterator[None]:
    use_displacement_unit(MICROMETRE)
    yield
    use_displacement_unit(MILLIMETRE)


def test_the_choices_are_the_units_of_the_catalogue() -> None:
    assert CHOICES["displacement_unit"] == {"mm": "mm", "um": "µm"}
    assert displacement_unit() is DISPLACEMENT_UNITS["mm"]


def test_a_displacement_has_the_same_resolution_in_both(micrometres: None) -> None:
    assert number_text.format_displacement(0.0123456, 2) == "12346\u202fµm"
    assert number_text.format_displacement(0.0123456, 4) == "12345.6\u202fµm"
    use_displacement_unit(MILLIMETRE)
    assert number_text.format_displacement(0.0123456, 2) == "12.35\u202fmm"
    assert number_text.format_displacement(float("nan")) == "–\u202fmm"


def test_results_on_screens_change_and_files_do_not(micrometres: None) -> None:
    run, slid = analysed(), definition("residual_displacement_m")
    row = results.make_row(slid, run.results[slid.name])
    assert (row.value, row.uncertainty, row.unit) == ("−10000", "11", "µm")
    assert [slid.unit_at(place).symbol for place in Place] == ["µm", "mm", "mm", "mm"]
    period = definition("period_s")
    assert period.unit_at(Place.WINDOW).symbol == "ms"


def test_readings_tare_and_guidance_of_record_change(micrometres: None) -> None:
    recorder = FakeRecorder()
    record = RecordPresenter(recorder, bench(), FakeWorker(), "me")  # type: ignore[arg-type]
    record.dispatch(Connecting("COM7"))
    record.dispatch(Connected("GSV-8", "1", 1000.0, "/ring"))
    record.dispatch(StateChanged(PullbackState.IDLE, 0.0))
    recorder.rows = rows_between(0.0, 1.5)
    record.tick()
    assert float(record.state.readings.table) == pytest.approx(200.0, abs=20.0)
    record.dispatch(Action.TARE)
    assert record.state.status_message.text.endswith("µm")
    recorder.rows = rows_between(1.5, 3.0)
    record.tick()
    record.dispatch(StateChanged(PullbackState.PULLING, 3.0, "", standing(PullbackState.PULLING)))
    assert record.state.guidance.instruction == "Pull the table back to 12000\u202fµm"


def test_curves_of_identify_change_with_their_titles(micrometres: None) -> None:
    curves = plot_data.curves(analysed())
    use_displacement_unit(MILLIMETRE)
    before = plot_data.curves(analysed())
    assert (curves.unit.symbol, before.unit.symbol) == ("µm", "mm")
    assert curves.residual_unit == before.residual_unit
    np.testing.assert_allclose(curves.channels[0].record, 1e3 * before.channels[0].record)


def test_readings_of_another_quantity_keep_their_unit(micrometres: None) -> None:
    assert plot_data.curves(analysed(unit="V")).unit.symbol == "V"


def test_processes_of_workers_use_the_unit_of_the_window(micrometres: None) -> None:
    worker, said = Worker(), []
    worker.submit(LazyFunction("analysis.catalogue", "displacement_unit"), done=said.append)
    deadline = time.monotonic() + 60.0
    while not said and time.monotonic() < deadline:
        worker.poll()
        time.sleep(0.01)
    worker.close()
    assert said == [MICROMETRE]


def test_the_motion_of_the_phase_plane_changes(micrometres: None) -> None:
    line = np.linspace(0.0, 1.0, 5)
    motion = plot_data.motion(analysed(kinematics=Kinematics(line, *[line] * 6)))
    assert motion is not None
    assert [drawn.unit for drawn in motion[PlotTab.PHASE]] == ["µm", "mm/s", "µm", "mm/s"]
