"""Reports of single runs: what the presenter says, and the files and pages that its tasks make."""

from pathlib import Path

import pytest
from reports_kit import write_run
from stage import FakeWorker

from app.presenters.base import Tone
from app.presenters.identify.report import ReportPresenter, ReportState
from app.presenters.identify.report_tasks import render_run_report, write_run_report
from app.presenters.recent import RecentItems

RUN = str(Path("/recordings/20260112_1FFM0_001.h5"))


class Desk:
    def __init__(self) -> None:
        self.worker, self.recent = FakeWorker(), RecentItems()
        self.report = ReportPresenter(self.worker, self.recent)  # type: ignore[arg-type]
        self.report.set_run(RUN)


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_the_next_report_goes_where_the_last_one_went(desk: Desk) -> None:
    assert desk.report.proposed_target == RUN.replace(".h5", ".pdf")
    desk.report.write("/reports/first.pdf")
    desk.worker.calls[-1].done("/reports/first.pdf")
    assert Path(desk.report.state.written_to) == Path("/reports")
    assert Path(desk.report.proposed_target) == Path("/reports/20260112_1FFM0_001.pdf")


def test_why_no_report_could_be_made_is_said(desk: Desk) -> None:
    desk.report.write("/reports/first.pdf")
    assert desk.report.state.is_busy
    desk.worker.calls[-1].fail("/reports is closed to you. Choose another folder")
    message = desk.report.state.message
    assert (message.tone, message.text) == (Tone.BAD, "/reports is closed to you. Choose another folder")
    assert not desk.report.state.is_busy


def test_a_report_of_a_run_that_is_left_is_given_up(desk: Desk) -> None:
    desk.report.write("/reports/first.pdf")
    desk.report.set_run("/recordings/other.h5")
    assert desk.worker.cancelled == 1
    desk.worker.calls[-1].cancel()
    assert desk.report.state == ReportState("/recordings/other.h5")


def test_a_report_is_a_pdf_file_and_pages_for_a_printer(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run.h5", facts={"excluded": "gauge 2 was touched"})
    target = tmp_path / "report.pdf"
    target.write_text("an older report")
    assert write_run_report(str(run), str(target)) == str(target)
    assert target.read_bytes().startswith(b"%PDF")
    pages = render_run_report(str(run))
    assert len(pages) > 1
    assert all(page.startswith(b"\x89PNG") for page in pages)
