import datetime
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from runs_kit import ENDING, block, small_run

from app.runs.blocks import BlockLayout, RunBlock
from app.runs.errors import MetadataError
from app.runs.metadata import Conditions, create_metadata
from app.runs.reader import load_counts, open_run
from app.runs.writer import write_run
from config.files import load_gauges, load_stand
from config.schema import Filter, Gauge, GaugeCheck, Gauges

TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=60)
LINE = st.text(st.characters(categories=["L", "M", "N", "P", "S"], include_characters=" "), max_size=60)
NUMBER = st.floats(allow_nan=False, allow_infinity=False, width=64)
POSITIVE = st.floats(1e-9, 1e9)
UNCERTAINTY = st.none() | st.floats(0.0, 1.0)
CHECKED = st.sampled_from([(), ("table",), ("relative",), ("table", "relative")])
DATES = st.none() | st.dates(datetime.date(1900, 1, 1))


def test_what_goes_in_comes_out(tmp_path, metadata):
    path = tmp_path / "run.h5"
    written = block(0, 20_000)

    stored = write_run(path, metadata, written, ENDING)
    run = open_run(path)

    assert stored.path == str(path)
    assert stored.samples == len(run) == 20_000
    assert run.metadata == metadata
    assert run.end == ENDING
    assert run.losses == ENDING.losses
    assert np.array_equal(run.time_s, written.time_s)
    assert np.array_equal(run.table_reading, written.readings[:, 0])
    assert np.array_equal(run.relative_reading, written.readings[:, 1])
    assert np.array_equal(run.status, written.status)
    assert np.array_equal(load_counts(run), written.counts)
    assert load_counts(run).dtype == np.int32


@pytest.mark.parametrize(
    "layout", [BlockLayout(1, "float64"), BlockLayout(1, ""), BlockLayout(2, "float64"), BlockLayout(2, "")]
)
def test_other_layouts(tmp_path, metadata, layout):
    written = block(5, 300, layout)

    write_run(tmp_path / "run.h5", metadata, written, ENDING)
    run = open_run(tmp_path / "run.h5", trusted=True)

    assert np.array_equal(run.table_reading, written.readings[:, 0])
    assert (run.relative_reading is None) == (layout.channels == 1)
    counts = load_counts(run)
    assert counts is None if written.counts is None else np.array_equal(counts, written.counts)


@st.composite
def filters(draw):
    kind = draw(st.sampled_from(["none", "rc", "butterworth", "bessel", "sinc"]))
    return Filter(kind, draw(st.integers(1, 8)), None if kind == "none" else draw(POSITIVE))


@st.composite
def gauges(draw):
    return Gauge(
        gain_m_per_count=draw(NUMBER.filter(bool)),
        zero_count=draw(NUMBER),
        gain_relative_standard_uncertainty=draw(UNCERTAINTY),
        zero_standard_uncertainty_m=draw(UNCERTAINTY),
        nonlinearity_m=draw(UNCERTAINTY),
        delay_s=draw(NUMBER),
        delay_standard_uncertainty_s=draw(st.floats(0.0, 1.0)),
        range_m=draw(st.none() | POSITIVE),
        measures=draw(st.sampled_from(["relative", "plate"])),
        serial_number=draw(TEXT),
        reference=draw(TEXT),
        date=draw(DATES),
        valid_until=draw(DATES),
        polynomial=tuple(draw(st.lists(NUMBER, max_size=2))),
        hysteresis_m=draw(UNCERTAINTY),
        repeatability_m=draw(UNCERTAINTY),
        certificate=draw(TEXT),
        calibrated_by=draw(TEXT),
        filter=draw(st.none() | filters()),
    )


@st.composite
def gauge_checks(draw, gauge):
    return GaugeCheck(
        gauge=gauge,
        at=draw(st.datetimes(timezones=st.just(datetime.UTC))),
        passed=draw(st.booleans()),
        expected_m=draw(NUMBER),
        measured_m=draw(NUMBER),
        tolerance_m=draw(st.floats(0.0, 1.0)),
        gain_m_per_count=draw(NUMBER),
        polynomial=tuple(draw(st.lists(NUMBER, max_size=2))),
        kind=draw(st.sampled_from(["displacement", "shunt"])),
        serial_number=draw(TEXT),
        reference=draw(TEXT),
        checked_by=draw(TEXT),
        device=draw(TEXT),
    )


@st.composite
def facts(draw):
    other = st.dictionaries(st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,20}", fullmatch=True), LINE.filter(bool))
    return create_metadata(
        load_stand().replace(
            gravity_m_per_s2=draw(POSITIVE), table_mass_standard_uncertainty_kg=draw(st.floats(0, 9))
        ),
        Gauges(table=draw(gauges()), relative=draw(gauges())),
        draw(
            st.datetimes(
                timezones=st.sampled_from([datetime.UTC, datetime.timezone(datetime.timedelta(hours=-5))]),
            ).filter(lambda begun: 1900 <= begun.year <= 9000)
        ),
        series=draw(st.sampled_from([None, "1FFM0", "3SSLM2"])),
        title=draw(TEXT.filter(bool)),
        table_mass_kg=draw(st.none() | POSITIVE),
        pullback_m=draw(st.none() | POSITIVE),
        operator=draw(TEXT),
        note=draw(TEXT),
        rate_hz=draw(st.none() | POSITIVE),
        conditions=Conditions(
            temperature_c=draw(st.none() | st.floats(-40.0, 80.0)),
            humidity_percent=draw(st.none() | st.floats(0.0, 100.0)),
            plate_id=draw(LINE),
            contact_id=draw(LINE),
            surface_preparation=draw(LINE),
            run_in_number=draw(st.none() | st.integers(0, 10**6)),
            other={k: v for k, v in draw(other).items() if k not in Conditions.__struct_fields__},
        ),
        gauge_checks=tuple(draw(gauge_checks(name)) for name in draw(CHECKED)),
        truth=draw(
            st.dictionaries(st.sampled_from(["a", "b_m"]), NUMBER | st.integers(-9, 9) | TEXT.filter(bool))
        ),
    )


@settings(max_examples=25, deadline=None)
@given(facts(), st.integers(0, 30), st.randoms(use_true_random=False))
def test_any_metadata_and_any_numbers_survive(metadata, count, random):
    any_bits = np.frombuffer(random.randbytes(24 * count), np.float64).reshape(3, count)
    written = RunBlock(
        any_bits[0], any_bits[1:].T, np.frombuffer(random.randbytes(count), np.uint8), any_bits[1:].T.copy()
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        write_run(path, metadata, written, ENDING)
        run = open_run(path, trusted=True)
        counts = load_counts(run)

    assert run.metadata == metadata
    assert run.time_s.tobytes() == written.time_s.tobytes()
    assert np.column_stack([run.table_reading, run.relative_reading]).tobytes() == written.readings.tobytes(
        "C"
    )
    assert run.status.tobytes() == written.status.tobytes()
    assert counts.tobytes() == written.counts.tobytes()


@pytest.mark.parametrize("text", ["a\0b", "lone \udc80 surrogate"])
def test_text_that_hdf5_cannot_hold_is_refused(tmp_path, metadata, text):
    with pytest.raises(MetadataError, match="title"):
        small_run(tmp_path / "run.h5", metadata.replace(title=text))
    assert list(tmp_path.iterdir()) == []


def test_layout_is_that_of_the_interface(tmp_path, metadata):
    """Read with literal names by h5py alone, as any other program would."""
    small_run(tmp_path / "run.h5", metadata, rows=10)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["NX_class"] == "NXroot"
        assert file.attrs["slipstand_schema"] == 1
        assert "creator" in file.attrs
        motion = file[file.attrs["default"]][file[file.attrs["default"]].attrs["default"]]
        assert motion.name == "/entry/motion"
        assert motion.attrs["signal"] == "table_displacement"
        assert list(motion.attrs["auxiliary_signals"]) == ["relative_displacement"]
        assert list(motion.attrs["axes"]) == ["time"]
        assert motion["time"].attrs["units"] == "s"
        assert motion["time"].attrs["start"] == metadata.start_time.isoformat()
        assert motion["table_displacement"].attrs["units"] == "m"
        assert motion["table_displacement"].dims[0][0] == motion["time"]
        assert motion["status"].dtype == np.uint8
        for name, nx_class in {
            "run": "NXcollection",
            "user": "NXuser",
            "sample": "NXsample",
            "motion": "NXdata",
            "instrument": "NXinstrument",
            "instrument/gauge_table": "NXdetector",
            "instrument/gauge_plate": "NXdetector",
            "instrument/gauge_plate/calibration": "NXcollection",
            "stand": "NXcollection",
            "acquisition": "NXcollection",
            "wire": "NXcollection",
            "events": "NXcollection",
            "truth": "NXcollection",
        }.items():
            assert file["entry"][name].attrs["NX_class"] == nx_class
        entry = file["entry"]
        assert entry["start_time"].asstr()[()] == metadata.start_time.isoformat()
        assert entry["end_time"].asstr()[()] == ENDING.end_time.isoformat()
        assert entry["run/series"].asstr()[()] == "1FFM1"
        assert entry["run/ended"].asstr()[()] == "rest"
        assert entry["stand/plate_mass"][()] == 27.4
        assert entry["stand/contact"].asstr()[()] == "fluoroplastic on fluoroplastic"
        assert entry["events/release_s"][()] == 2.25
        assert entry["acquisition/clock_scale"][()] == ENDING.time_base.scale
        assert entry["instrument/gauge_table/data"].dtype == np.int32
        assert entry["truth"].attrs["friction_dynamic"] == 0.1


def test_plate_against_base_is_called_what_it_is(tmp_path, metadata):
    relative = load_gauges().relative.replace(measures="plate")
    gauges_of_run = Gauges(table=load_gauges().table, relative=relative)
    small_run(tmp_path / "run.h5", metadata.replace(gauges=gauges_of_run))
    with h5py.File(tmp_path / "run.h5") as file:
        assert "plate_displacement" in file["entry/motion"]
    assert open_run(tmp_path / "run.h5", trusted=True).metadata.gauges.relative.measures == "plate"
