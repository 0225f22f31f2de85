import json
import math
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from runs_kit import ENDING, block

from analysis.identification import Events, FittedModel, Identification, ModelSelection
from analysis.quantities import BudgetLine, BudgetSource, Quantity, ResultWarning
from app.runs.analysis_input import to_record
from app.runs.edits import edit_run
from app.runs.reader import open_run
from app.runs.saved_analyses import (
    analysis_document,
    inputs_hash,
    latest_valid,
    read_all_analyses,
    save_analysis,
)
from app.runs.validator import shared_validator
from app.runs.writer import write_run
from drivers.samples import Losses
from messages.message import message

RESULT = Identification(
    kind="two-mass",
    results={
        "friction_dynamic": Quantity(0.1001, 0.0004, (0.0993, 0.1009), "1"),
        "period_s": Quantity.normal(0.32, 1e-5, "s"),
        "friction_static": Quantity(0.2, math.nan, (math.nan, math.nan), "1"),
        "tilt_rad": Quantity(math.nan, 1.0, (0.0, 1.0), "rad"),
    },
    labels={"msk64_degree": "IX", "coulomb_significant": False},
    model=ModelSelection(
        "coulomb",
        True,
        2.1e-5,
        2e-5,
        (FittedModel("coulomb", -7.0, 2.1e-5, 0.1001), FittedModel("static", math.inf, 2e-5, 0.1)),
    ),
    budget=[BudgetLine(BudgetSource.GAUGE_1_GAIN, "friction_dynamic", 3e-4)],
    events=Events(release_s=2.25, slip_end_s=4.5, rest_s=None, slip_end_uncertainty_s=0.002),
    warnings=[ResultWarning("tail-too-short", message("only 1.5 periods of tail"))],
)


@pytest.fixture(scope="module")
def stored_run(tmp_path_factory, metadata):
    path = tmp_path_factory.mktemp("stored") / "run.h5"
    write_run(path, metadata, block(0, 100), ENDING)
    return path


@pytest.fixture(scope="module")
def analysed_run(stored_run, tmp_path_factory):
    path = Path(shutil.copy(stored_run, tmp_path_factory.mktemp("analysed")))
    run = open_run(path)
    save_analysis(path, _document(run), inputs_hash(to_record(run)), {"model": "auto"})
    return path


@pytest.fixture
def run_path(stored_run, tmp_path):
    """A run of the test's own."""
    return Path(shutil.copy(stored_run, tmp_path))


@pytest.fixture
def analysed_path(analysed_run, tmp_path):
    """A run of the test's own with a result kept in it."""
    return Path(shutil.copy(analysed_run, tmp_path))


def _document(run):
    return analysis_document(run.path, run.metadata.series, run.losses, RESULT)


def test_document_is_that_of_the_interface(run_path):
    document = json.loads(json.dumps(_document(open_run(run_path)), allow_nan=False))

    assert document["schema"] == "slipstand-analysis/1"
    assert (document["run"], document["series"], document["kind"]) == (str(run_path), "1FFM1", "two-mass")
    assert document["results"]["friction_dynamic"] == {
        "value": 0.1001, "standard_uncertainty": 0.0004, "interval_95": [0.0993, 0.1009], "unit": "1",
        "expanded_uncertainty": 0.0008, "coverage_factor": 2.0,
    }  # fmt: skip
    assert document["results"]["msk64_degree"] == "IX"
    assert document["results"]["coulomb_significant"] is False
    assert "tilt_rad" not in document["results"]
    assert document["results"]["friction_static"]["standard_uncertainty"] is None
    assert document["model"]["name"] == "coulomb"
    assert document["model"]["tried"][1] == {
        "name": "static", "bic": None, "residual_rms_m": 2e-5, "friction_dynamic": 0.1, "parts": [],
    }  # fmt: skip
    assert document["budget"][0]["source"] == "gauge 1 gain"
    assert document["events"] == {
        "release_s": 2.25,
        "slip_end_s": 4.5,
        "rest_s": None,
        "free_decay_end_s": None,
        "release_uncertainty_s": None,
        "slip_end_uncertainty_s": 0.002,
        "rest_uncertainty_s": None,
    }
    assert document["warnings"] == [{"code": "tail-too-short", "message": "only 1.5 periods of tail"}]
    assert {k: document["quality"][k] for k in ("samples", "missing", "damaged", "overloaded")} == {
        "samples": 9, "missing": 2, "damaged": 3, "overloaded": 4,
    }  # fmt: skip


def test_analyses_are_kept_beside_each_other(run_path):
    run = open_run(run_path)
    first, second = _document(run), _document(run) | {"kind": "again"}
    inputs = inputs_hash(to_record(run))

    assert save_analysis(run_path, first, inputs, {"model": "auto"}) == 1
    assert save_analysis(run_path, second, inputs) == 2

    run = open_run(run_path)
    assert [saved.document for saved in run.analyses] == [first, second]
    assert [saved.number for saved in run.analyses] == [1, 2]
    assert run.analyses[0].settings == {"model": "auto"}
    assert latest_valid(run.analyses, to_record(run)) == run.analyses[1]
    with h5py.File(run_path) as file:
        group = file["entry/analysis_001"]
        assert group.attrs["NX_class"] == "NXprocess"
        assert group["program"].asstr()[()] == "slipstand"
        friction = group["results/friction_dynamic"]
        assert (friction[()], friction.attrs["units"]) == (0.1001, "1")
        assert friction.attrs["standard_uncertainty"] == 0.0004
        assert group["results/msk64_degree"].asstr()[()] == "IX"
        assert group["model/adequate"][()]
        assert list(group["budget/source"].asstr()) == ["gauge 1 gain"]
        assert np.isnan(group["tried/bic"][1])


def test_an_analysis_that_is_not_what_was_kept_is_not_taken(run_path):
    run = open_run(run_path)
    inputs = inputs_hash(to_record(run))
    for document in (_document(run), _document(run) | {"kind": "again"}):
        save_analysis(run_path, document, inputs, {"model": "auto"})
    with h5py.File(run_path, "r+") as file:
        text = file["entry/analysis_002/document"]
        text[()] = text[()].replace(b"0.1001", b"0.1991")

    run = open_run(run_path)
    assert [saved.number for saved in run.analyses] == [1]
    with h5py.File(run_path) as file:
        assert read_all_analyses(file)[1] == (2,)
    summary = shared_validator().validate(run_path)
    assert (summary.friction_dynamic, summary.damaged_analyses) == (0.1001, 1)


def _set(path, value):
    def change(group):
        group[path][()] = value

    return change


def _set_attribute(path, name, value):
    def change(group):
        group[path].attrs[name] = value

    return change


def _set_cell(path, row, value):
    def change(group):
        group[path][row] = value

    return change


def _add(path, value):
    def change(group):
        group[path] = value

    return change


@pytest.mark.parametrize("has_checksum", [True, False])
@pytest.mark.parametrize(
    "change",
    [
        _set("results/friction_dynamic", 0.1991),
        _set("results/msk64_degree", b"X"),
        _set("results/coulomb_significant", True),
        _set_attribute("results/friction_dynamic", "standard_uncertainty", 4e-5),
        _set_attribute("results/friction_dynamic", "interval_95", [0.0, 1.0]),
        _set_attribute("results/period_s", "units", "ms"),
        _set_attribute("results/friction_static", "standard_uncertainty", 0.001),
        _add("results/tilt_rad", 0.001),
        _set("model/adequate", False),
        _set_cell("tried/friction_dynamic", 1, 0.2),
        _set_cell("tried/bic", 1, -9.0),
        _set_cell("budget/standard_uncertainty", 0, 3e-5),
        _set_cell("budget/source", 0, b"gauge 2 gain"),
        _set("events/release_s", 2.5),
        _set_cell("warnings/code", 0, b"no-slip"),
    ],
)
def test_a_result_whose_fields_differ_from_its_text_is_not_taken(analysed_path, change, has_checksum):
    with h5py.File(analysed_path, "r+") as file:
        if not has_checksum:
            del file["entry/analysis_001/crc32"]
        assert len(read_all_analyses(file)[0]) == 1
        assert read_all_analyses(file)[1] == ()
        change(file["entry/analysis_001"])

    assert open_run(analysed_path).analyses == ()
    assert shared_validator().validate(analysed_path).damaged_analyses == 1


def test_an_analysis_of_a_version_without_checksum_is_taken(run_path):
    run = open_run(run_path)
    save_analysis(run_path, _document(run), inputs_hash(to_record(run)))
    with h5py.File(run_path, "r+") as file:
        for name in ("crc32", "commit", "request_hash", "reproduce"):
            file["entry/analysis_001"].pop(name, None)

    (saved,) = open_run(run_path).analyses
    document = saved.document_of(run_path, run.metadata, run.identifier, has_gauge_2=True)
    origin = document["origin"]
    assert (origin["version"], origin["commit"]) == (saved.version, None)
    assert origin["inputs_hash"] == inputs_hash(to_record(run))
    assert origin["reproduce"] == f"slipstand analyze {run_path}"


@pytest.mark.parametrize("change", ["plate_mass_kg", "gauges", "note"])
def test_a_result_is_stale_once_its_inputs_changed(run_path, metadata, change):
    run = open_run(run_path)
    save_analysis(run_path, _document(run), inputs_hash(to_record(run)))
    table = metadata.gauges.table.replace(gain_relative_standard_uncertainty=0.02)
    new = {"plate_mass_kg": 30.0, "gauges": metadata.gauges.replace(table=table), "note": "nothing physical"}

    edit_run(run_path, "Ada", **{change: new[change]})

    run = open_run(run_path)
    still_valid = latest_valid(run.analyses, to_record(run)) is not None
    assert still_valid == (change == "note")


def test_quality_counts_every_loss(run_path):
    losses = Losses(samples=10, missing=1, missing_estimated=2, damaged=3, overloaded=4)
    quality = analysis_document(run_path, None, losses, RESULT)["quality"]
    assert quality == {"samples": 10, "missing": 1, "missing_estimated": 2, "damaged": 3, "overloaded": 4}
