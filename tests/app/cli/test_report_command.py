"""`slipstand report`: a PDF to sign, and what is refused."""

import pytest
from reports_kit import write_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run without slip: its figures are few."""
    return write_run(tmp_path_factory.mktemp("runs") / "still.h5", "3SSM0", friction_dynamic=0.8)


def test_report_is_written_and_told(slipstand, run, tmp_path):
    target = tmp_path / "report.pdf"
    said = slipstand("report", run, "-o", target, "--date", "2026-11-21", "--json")

    assert said.code == 0
    told = {"report": str(target), "date": "2026-11-21", "runs": [str(run)], "failures": []}
    assert said.json == told | {"origin": said.json["origin"], "number": said.json["number"]}
    assert said.json["number"].startswith("20261121-")
    assert said.json["origin"]["reproduce"].startswith("slipstand report")
    first = target.read_bytes()
    assert first.startswith(b"%PDF")
    again = slipstand("report", run, "-o", target, "--date", "2026-11-21", "--force")
    assert again.out.strip() == str(target)
    assert target.read_bytes() == first


def test_a_run_that_fails_is_told_and_does_not_stop_the_rest(slipstand, run, tmp_path):
    said = slipstand("report", run, tmp_path / "nowhere.h5", "-o", tmp_path / "report.pdf")

    assert said.code == 1
    assert "nowhere.h5" in said.err
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (("--date", "21.11.2026"), "--date '21.11.2026' is no date"),
        (("-o", "report.doc"), "report.doc has no known ending. Use .pdf"),
        (("-o", "no/such/folder/report.pdf"), "is not a folder"),
        (("--exclude", "other"), "--exclude other is none"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(slipstand, run, tmp_path, monkeypatch, arguments, fault):
    monkeypatch.chdir(tmp_path)
    output = () if "-o" in arguments else ("-o", "report.pdf")
    said = slipstand("report", run, *output, *arguments)

    assert said.code == 1
    assert fault in said.err
    assert said.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_existing_reports_and_folders_without_runs_are_refused(slipstand, run, tmp_path):
    (tmp_path / "report.pdf").write_text("mine", "utf-8")
    existing = slipstand("report", run, "-o", tmp_path / "report.pdf")
    empty = slipstand("report", tmp_path, "-o", tmp_path / "other.pdf")
    unread = slipstand("report", tmp_path / "nowhere.h5", "-o", tmp_path / "other.pdf")

    assert existing.code == empty.code == unread.code == 1
    assert "exists already" in existing.err
    assert "there are no runs" in empty.err
    assert "there is no such file" in unread.err
    assert [file.name for file in tmp_path.iterdir()] == ["report.pdf"]
