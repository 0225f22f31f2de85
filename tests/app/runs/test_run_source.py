"""Where the samples of a run come from is a field of its file, and derived for files without that field."""

import gzip
import shutil
from pathlib import Path

import h5py
import pytest
from runs_kit import END, small_run

from app.runs.listing import list_runs
from app.runs.metadata import IMPORT_PROTOCOL, SIMULATION_PROTOCOL, RunMetadata, RunSource, create_metadata
from app.runs.reader import open_run
from app.runs.run_filter import RunFilter
from config.files import load_gauges, load_stand
from drivers.samples import DeviceIdentity

OLD_RUNS = Path(__file__).resolve().parents[2] / "golden" / "old_runs"


def recorded(**facts: object) -> RunMetadata:
    facts = {"device": DeviceIdentity("gsv", "GSV-8", firmware="1.45"), "port": "/dev/ttyUSB0"} | facts
    return create_metadata(load_stand(), load_gauges(), END, **facts)


@pytest.mark.parametrize(
    ("facts", "source"),
    [
        ({}, RunSource.REAL),
        ({"port": "socket://127.0.0.1:4001"}, RunSource.REAL),
        ({"port": "/dev/ttyACM0 USB 2341:0043 slipstand-stand-1"}, RunSource.REAL),
        ({"stated_source": RunSource.SIMULATED}, RunSource.SIMULATED),
        ({"port": "/tmp/slipstand-stand-ab12/port"}, RunSource.SIMULATED),
        ({"port": "/tmp/slipstand-stand-ab12/port + /tmp/slipstand-stand-cd34/port"}, RunSource.SIMULATED),
        ({"port": "lsl://slipstand-4711"}, RunSource.SIMULATED),
        ({"port": "lsl://LoadCell"}, RunSource.REAL),
        ({"device": DeviceIdentity("slipstand-binary", "fw", firmware="simulated-1")}, RunSource.SIMULATED),
        ({"device": DeviceIdentity(SIMULATION_PROTOCOL, "exact simulation")}, RunSource.SIMULATED),
        ({"truth": {"friction_dynamic": 0.1}}, RunSource.SIMULATED),
        (
            {"device": DeviceIdentity(IMPORT_PROTOCOL, "a.csv"), "truth": {"tilt_rad": 0.0}},
            RunSource.IMPORTED,
        ),
    ],
)
def test_the_source_is_stated_in_the_file_and_in_the_library(tmp_path, facts, source):
    path = tmp_path / "run.h5"
    small_run(path, recorded(**facts))
    with h5py.File(path) as file:
        assert file["entry/run/source_type"][()].decode() == source
    assert open_run(path).metadata.source_type is source
    (listed,) = list_runs(tmp_path)
    assert listed.source is source


def test_a_stated_source_is_preferred_to_what_the_device_looks_like(tmp_path):
    path = tmp_path / "run.h5"
    small_run(path, recorded(port="/tmp/slipstand-stand-ab12/port").replace(stated_source=RunSource.REAL))
    assert open_run(path).metadata.source_type is RunSource.REAL


def test_runs_of_versions_that_did_not_state_it_are_told_by_what_they_hold(tmp_path):
    for packed in OLD_RUNS.glob("*.h5.gz"):
        with gzip.open(packed) as file, (tmp_path / packed.stem).open("wb") as target:
            shutil.copyfileobj(file, target)
    found = {Path(run.path).stem: run.source for run in list_runs(tmp_path)}
    assert found.pop("coulomb-1FFM0") is RunSource.IMPORTED
    assert found.pop("simulated-2FFM3") is RunSource.SIMULATED
    assert found.pop("recorded-slipstand-binary") is RunSource.SIMULATED
    assert found.pop("recorded-gsv") is RunSource.REAL  # at a TCP port nothing tells it from an amplifier
    assert set(found.values()) == set(RunSource)


def test_the_text_of_a_search_finds_a_source(tmp_path):
    small_run(tmp_path / "a.h5", recorded(stated_source=RunSource.SIMULATED))
    small_run(tmp_path / "b.h5", recorded(note="the real plate"))
    small_run(tmp_path / "c.h5", recorded())
    assert len(list_runs(tmp_path, RunFilter(text="Simulated"))) == 1
    assert len(list_runs(tmp_path, RunFilter(text="imported"))) == 0


def test_a_file_that_cannot_be_read_has_no_source(tmp_path):
    (tmp_path / "run.h5").write_bytes(b"no run")
    (listed,) = list_runs(tmp_path)
    assert listed.source is None


def test_what_no_stand_gave_has_an_origin_in_words():
    assert recorded().origin == ""
    assert recorded(stated_source=RunSource.SIMULATED).origin == "simulated"
    imported = DeviceIdentity(IMPORT_PROTOCOL, "a.csv")
    assert recorded(device=imported, source="imported from a.csv").origin == "imported from a.csv"
