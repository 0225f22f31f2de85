"""`slipstand table`: from run files to the paper's table."""

import csv
import io
import shutil

import pytest
from reports_kit import write_run

from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import analyze_run
from config.files import published_row


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    for number in (1, 2):
        write_run(folder / f"ff{number}.h5", seed=number)
    write_run(folder / "ss.h5", "1SSM0", seed=3)
    for path in folder.iterdir():
        analyze_run(path, AnalysisRequest(classical=False), save=True)
    return folder


def test_table_pools_the_runs_of_a_folder(slipstand, folder):
    said = slipstand("table", folder, "--json")
    first, second = said.json["rows"]
    friction = first["friction_dynamic"]
    truth = published_row("1FFM0").friction_dynamic

    assert said.code == 0
    assert [first["series"], second["series"]] == ["1FFM0", "1SSM0"]
    assert first["runs"] == [str(folder / "ff1.h5"), str(folder / "ff2.h5")]
    assert (friction["runs"], second["friction_dynamic"]["runs"]) == (2, 1)
    assert friction["interval_95"][0] < truth < friction["interval_95"][1]
    assert first["plate_mass_kg"]["standard_uncertainty"] == pytest.approx(0.02)
    assert {"series-without-runs"} <= {one["code"] for one in said.json["warnings"]}
    again = slipstand("table", folder, "--format", "json").json
    assert again.pop("origin").keys() == said.json["origin"].keys()
    assert again == {name: value for name, value in said.json.items() if name != "origin"}


def test_text_fits_the_terminal(slipstand, folder, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    said = slipstand("table", folder, "--published", "--repeats")

    assert said.code == 0
    assert max(map(len, [line for line in said.out.splitlines() if str(folder) not in line])) <= 80
    assert "Measured minus published" in said.out
    assert "stiffness_n_per_m" in said.out


def test_excluded_runs_are_listed_with_their_reason(slipstand, folder):
    said = slipstand(
        "table", folder, "--exclude", "ff2=the table was bumped", "--exclude", "ss.h5", "--json"
    ).json

    assert [row["series"] for row in said["rows"]] == ["1FFM0"]
    assert said["rows"][0]["friction_dynamic"]["runs"] == 1
    assert said["excluded"] == [
        {"run": str(folder / "ff2.h5"), "reason": "the table was bumped"},
        {"run": str(folder / "ss.h5"), "reason": "no reason given"},
    ]


def test_runs_that_are_left_out_for_good_are_so_in_every_table_until_taken_in_again(slipstand, tmp_path):
    for number in range(2):
        write_run(tmp_path / f"ff{number}.h5", "1FFM0", seed=number)
    run = tmp_path / "ff1.h5"
    assert slipstand("edit", run, "--exclude", "the table was bumped").code == 0

    said = slipstand("table", tmp_path, "--json").json
    assert said["excluded"] == [{"run": str(run), "reason": "the table was bumped"}]
    assert said["rows"][0]["friction_dynamic"]["runs"] == 1
    assert slipstand("runs", tmp_path, "--json").json[1]["excluded"] == "the table was bumped"
    other = slipstand("table", tmp_path, "--exclude", "ff1=gauge 2 was touched", "--json").json
    assert other["excluded"][0]["reason"] == "gauge 2 was touched"

    slipstand("edit", run, "--include")
    assert slipstand("table", tmp_path, "--json").json["excluded"] == []
    assert 'excluded = "the table was bumped"' in slipstand("edit", run, "--history").out


@pytest.mark.parametrize("options", [("--exclude", " "), ("--exclude", "touched", "--include")])
def test_leaving_out_needs_a_reason_and_one_wish(slipstand, folder, options):
    said = slipstand("edit", folder / "ss.h5", *options)
    assert said.code == 1
    assert "--exclude" in said.err
    assert said.err.count("\n") == 1


def test_run_that_fails_does_not_stop_the_rest(slipstand, folder, tmp_path):
    shutil.copy(folder / "ss.h5", tmp_path / "ss.h5")
    (tmp_path / "broken.h5").write_bytes(b"no run")
    said = slipstand("table", tmp_path, "--json")
    excluded = slipstand("table", tmp_path, "--exclude", "broken=cut off", "--json")

    assert said.code == 1
    assert [row["series"] for row in said.json["rows"]] == ["1SSM0"]
    assert said.json["failures"][0]["run"] == str(tmp_path / "broken.h5")
    assert said.err.splitlines() == [f"error: {tmp_path / 'broken.h5'}: {said.json['failures'][0]['error']}"]
    assert excluded.code == 0
    assert excluded.json["excluded"] == [{"run": str(tmp_path / "broken.h5"), "reason": "cut off"}]


def test_csv_alone_is_on_stdout(slipstand, folder):
    said = slipstand("table", folder, "--format", "csv")

    assert [row["series"] for row in csv.DictReader(io.StringIO(said.out))] == ["1FFM0", "1SSM0"]
    assert "What f_d depends on: " in said.err


def test_new_analyses_are_kept_when_asked(slipstand, tmp_path):
    write_run(tmp_path / "ss.h5", "1SSM0", seed=3)
    first = slipstand("table", tmp_path, "--save", "--json").json
    again = slipstand("table", tmp_path, "--json").json

    assert first["rows"] == again["rows"]
    assert "f_d" in slipstand("runs", tmp_path).out
    assert slipstand("runs", tmp_path, "--json").json[0]["friction_dynamic"] is not None


def test_files_are_written_and_not_overwritten(slipstand, folder, tmp_path):
    book, text = tmp_path / "t.xlsx", tmp_path / "t.tex"

    assert slipstand("table", folder, "--format", "xlsx", "-o", book).out.strip() == str(book)
    assert slipstand("table", folder, "--format", "latex", "-o", text).code == 0
    assert book.read_bytes().startswith(b"PK")
    assert "\\toprule" in text.read_text("utf-8")
    assert "exists already" in slipstand("table", folder, "--format", "latex", "-o", text).err


@pytest.mark.parametrize(
    ("name", "mark"),
    [
        ("t.xlsx", b"PK"),
        ("t.csv", b"series,"),
        ("t.JSON", b'"schema"'),
        ("t.md", b"| series |"),
        ("t.txt", b"series  n "),
        ("t", b"series  n "),
    ],
)
def test_the_ending_of_a_file_says_its_format(slipstand, folder, tmp_path, name, mark):
    path = tmp_path / name
    slipstand("table", folder, "-o", path)
    assert mark in path.read_bytes()


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (("--format", "pdf"), "--format 'pdf' is not known"),
        (("--format", "xlsx"), "-o TABLE.xlsx"),
        (("-o", "table.pdf"), "has no known ending"),
        (("--format", "csv", "--json"), "contradict each other"),
        (("--exclude", "nobody"), "--exclude nobody is none of the 3 runs"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(slipstand, folder, options, fault):
    said = slipstand("table", folder, *options)

    assert said.code == 1
    assert fault in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


def test_friction_of_the_plate_alone_is_a_column_that_is_asked_for(slipstand, folder):
    plain, wider = (
        next(csv.reader(io.StringIO(slipstand("table", folder, "--format", "csv", *more).out)))
        for more in ((), ("--column", "friction_dynamic_plate"))
    )
    assert "friction_dynamic_plate" not in plain
    assert "friction_dynamic_plate" in wider
    assert "f_dp" in slipstand("table", folder, "--column", "friction_dynamic_plate").out
    first = slipstand("table", folder, "--json").json["rows"][0]
    found, other = first["friction_dynamic_plate"], first["friction_dynamic"]
    assert found["value"] == pytest.approx(other["value"], abs=4.0 * found["standard_uncertainty"])
    refused = slipstand("table", folder, "--column", "period_s")
    assert refused.code == 1
    assert "--column 'period_s' is not known. Use friction_dynamic_plate" in refused.err
