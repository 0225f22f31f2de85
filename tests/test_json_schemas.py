"""What `--json` prints is what the published schemas say."""

import json

import jsonschema
import msgspec
import pytest
import typer
from schema_kit import check, closed, schema_name
from typer.core import TyperGroup

from analysis.synthetic import Truth, simulate_readings
from app.acquisition.messages import EndReason, RunEnded
from app.cli.commands import app
from app.cli.record import run_document
from tools.json_schemas import FOLDER, SCHEMAS, schema_text


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture
def run(slipstand, folder):
    path = folder / "run.h5"
    if not path.exists():
        slipstand("simulate", "--series", "1FFM0", "-o", path)
        slipstand("analyze", path, "--save")
    return path


def test_the_published_schemas_are_current() -> None:
    assert {path.name for path in FOLDER.iterdir()} == {f"{name}.schema.json" for name in SCHEMAS}
    for name in SCHEMAS:
        jsonschema.Draft202012Validator.check_schema(SCHEMAS[name][1])
        jsonschema.Draft202012Validator.check_schema(closed(SCHEMAS[name][1]))
        assert (FOLDER / f"{name}.schema.json").read_text("utf-8") == schema_text(name), (
            "run python -m tools.json_schemas"
        )


def test_each_command_with_json_has_a_schema() -> None:
    """Tests of the commands hold what they print against it: `Outcome.json`."""

    def commands(command, words):
        if isinstance(command, TyperGroup):
            context = typer.Context(command)
            for name in command.list_commands(context):
                yield from commands(command.get_command(context, name), (*words, name))
        if any("--json" in param.opts for param in command.params):
            yield words

    names = {schema_name((*words, "--json")) for words in commands(typer.main.get_command(app), ())}
    assert names | {"demo-campaign"} == set(SCHEMAS)
    assert schema_name(("demo", "--campaign", "--json")) == "demo-campaign"


def test_a_key_that_a_schema_lacks_is_refused() -> None:
    document = {"port": "COM3", "protocol": "gsv", "rate_hz": 1.0, "series": "1FFM0"}
    document |= {"truth_file": None, "calibration": None}
    check("device-simulate", document)
    with pytest.raises(jsonschema.ValidationError, match="unexpected"):
        check("device-simulate", document | {"more": 1})


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("simulate", ["simulate", "--series", "2SSM1"]),
        ("plan", ["plan", "--series", "2SSM1", "--ideal-stand"]),
        ("audit", ["audit"]),
        ("device-list", ["device", "list"]),
        ("doctor", ["doctor"]),
    ],
)
def test_commands_without_a_run(slipstand, name, command) -> None:
    check(name, slipstand(*command, "--json").json)


def test_commands_with_runs(slipstand, run, folder, tmp_path) -> None:
    check("analyze", slipstand("analyze", run, folder / "absent.h5", "--json").json)
    check("analyze", slipstand("analyze", run, "--kind", "one-mass", "--json").json)
    check("table", slipstand("table", run, "--json").json)
    check("runs", slipstand("runs", folder, "--json").json)
    check("export", slipstand("export", run, "--format", "csv", "-o", tmp_path / "run.csv", "--json").json)


def test_import(slipstand, tmp_path) -> None:
    rows = zip(*simulate_readings(Truth(rate_hz=200.0)), strict=True)
    (tmp_path / "a.csv").write_text(
        "\n".join(["t,u1,u2", *(",".join(map(repr, map(float, row))) for row in rows)])
    )
    columns = ("--time", "t", "--table", "u1", "--relative", "u2", "-o", tmp_path / "a.h5")
    check("import", slipstand("import", tmp_path / "a.csv", *columns, "--json").json)


@pytest.mark.parametrize("reason", EndReason)
def test_a_recording_however_it_ended(reason) -> None:
    ended = RunEnded("/runs/a.h5", reason, 100, 0, 0, 0, 0, 1000.0, 1.0)
    check("record", json.loads(msgspec.json.encode(run_document(ended))))


@pytest.mark.parametrize("document", [{}, {"run": "a", "samples": -1}, [{"run": 1, "error": "x"}]])
def test_schemas_refuse_what_is_none(document) -> None:
    for name in ("analyze", "record"):
        with pytest.raises(jsonschema.ValidationError):
            check(name, document)
