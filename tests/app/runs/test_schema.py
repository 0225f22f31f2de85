"""The declared tables of the run file agree with the types in memory, the written files and the reference."""

import operator

import h5py
import msgspec
import pytest

from app.runs import schema
from app.runs.errors import DamagedRunError
from app.runs.metadata import EndMetadata, Events
from app.runs.reader import open_run
from app.runs.validation import validate_file
from app.runs.writer import create_run
from config.schema import Gauge, GaugeCheck
from drivers.clock import TimeBase
from drivers.samples import Losses
from tests.app.runs.runs_kit import ENDING, block
from tools.run_file_reference import REFERENCE, reference

DERIVED = {"losses", "events", "time_base"}


def declared(fields):
    return {field.attribute for field in fields if field.attribute}


def test_the_reference_page_is_that_of_the_tables():
    assert REFERENCE.read_text(encoding="utf-8") == reference(), "run python -m tools.run_file_reference"


def test_every_value_of_the_end_has_its_field():
    expected = set(EndMetadata.__struct_fields__) - DERIVED
    expected |= {f"events.{name}" for name in Events.__struct_fields__}
    expected |= {f"losses.{name}" for name in Losses.__slots__}
    expected |= {f"time_base.{name}" for name in TimeBase.__struct_fields__}
    assert declared(schema.END_FIELDS) == expected


@pytest.mark.parametrize(
    ("fields", "kind", "elsewhere"),
    [(schema.GAUGE_FIELDS, Gauge, set()), (schema.CHECK_FIELDS, GaugeCheck, {"gauge"})],
)
def test_every_value_of_a_gauge_has_its_field(fields, kind, elsewhere):
    assert declared(fields) == set(kind.__struct_fields__) - elsewhere


def test_paths_are_declared_once():
    paths = [field.path for field in (*schema.RUN_FIELDS, *schema.END_FIELDS, *schema.PROGRAM_FIELDS)]
    assert len(set(paths)) == len(paths)


def test_a_run_holds_no_field_that_is_not_declared(tmp_path, metadata):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 10))
    writer.close(ENDING)
    known = {field.path for field in (*schema.RUN_FIELDS, *schema.END_FIELDS, *schema.PROGRAM_FIELDS)}
    for gauge in schema.GAUGES:
        known |= {f"{gauge}/{field.path}" for field in schema.GAUGE_FIELDS}
        known |= {f"{gauge}/{schema.LAST_CHECK}/{field.path}" for field in schema.CHECK_FIELDS}
    known |= {column.path for column in schema.WIRE_COLUMNS} | {schema.count_path(0), schema.count_path(1)}
    open_groups = (schema.MOTION, schema.CHECKSUMS, schema.OTHER_CONDITIONS, f"{schema.STAND}/geometry")
    found = []
    with h5py.File(tmp_path / "run.h5", "r") as file:
        file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
    assert [name for name in found if name not in known and not name.startswith(open_groups)] == []


def test_what_a_field_declares_is_what_is_read(tmp_path, metadata):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 10))
    writer.close(ENDING)
    run = open_run(tmp_path / "run.h5", trusted=True)
    for field in schema.RUN_FIELDS:
        if field.attribute:
            value = operator.attrgetter(field.attribute)
            assert value(run.metadata) == value(metadata), field.path
    assert msgspec.to_builtins(run.end) == msgspec.to_builtins(ENDING)


@pytest.mark.parametrize("path", [field.path for field in schema.REQUIRED_FIELDS])
def test_a_run_without_a_required_field_is_damaged(tmp_path, metadata, path):
    writer = create_run(tmp_path / "run.h5", metadata)
    writer.append(block(0, 10))
    writer.close(ENDING)
    with h5py.File(tmp_path / "run.h5", "r+") as file:
        del file[path]
    with (
        h5py.File(tmp_path / "run.h5", "r") as file,
        pytest.raises(DamagedRunError, match=path.split("/")[-1]),
    ):
        validate_file(file)
