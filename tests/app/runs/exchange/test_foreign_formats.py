"""Files of other programs, written at test time, come back to the last bit through the limited process."""

import datetime
import gzip
import hashlib
import json
import os
import pickle
import struct
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from app.runs.errors import ImportFileError
from app.runs.exchange import reading_process
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.foreign_files import open_foreign
from app.runs.exchange.importing import ImportPlan, read_record
from app.runs.exchange.reading_process import ReadingProcess, shared_reading_process
from app.runs.exchange.recognition import ParseOptions, preview_file

# pyuff 2.5.8 does not close the file that it writes.
pytestmark = pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)
ROWS, RATE_HZ = 200, 500.0
TIME_S = np.arange(ROWS) / RATE_HZ
TABLE = np.sin(0.1 * np.arange(ROWS)) * 12.0
RELATIVE = np.cos(0.1 * np.arange(ROWS)) / 3.0
BEGUN = datetime.datetime(2019, 5, 4, 14, 3, 7, 250000, tzinfo=datetime.UTC)


def write_matlab_73(path):
    hdf5storage = pytest.importorskip("hdf5storage")
    content = {"t": TIME_S, "both": np.column_stack([TABLE, RELATIVE]), "name": "a test"}
    hdf5storage.savemat(path, content, appendmat=False, oned_as="column", store_python_metadata=False)


def write_tdms(path):
    nptdms = pytest.importorskip("nptdms")
    facts = {"wf_increment": 1 / RATE_HZ, "wf_start_offset": 0.0, "unit_string": "mm",
             "wf_start_time": np.datetime64(BEGUN.replace(tzinfo=None), "us")}  # fmt: skip
    channels = (("u1", TABLE), ("rel", RELATIVE))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("gauges", name, data, facts) for name, data in channels])


def write_lvm(path):
    lvmio = pytest.importorskip("lvmio")
    start = BEGUN.astimezone()
    channels = [
        lvmio.Channel(name, data.tolist(), "mm", delta_x=1 / RATE_HZ)
        for name, data in (("u1", TABLE), ("rel", RELATIVE))
    ]
    date, begun = f"{start:%Y/%m/%d}", f"{start:%H:%M:%S.%f}"
    lvmio.write_lvm(path, channels, date=date, time=begun, precision=17)


def write_universal(path):
    pyuff = pytest.importorskip("pyuff")
    none = dict.fromkeys((f"{axis}_{kind}_unit_exp" for axis in ("abscissa", "ordinate", "orddenom", "z_axis")
                          for kind in ("len", "force", "temp")), 0)  # fmt: skip
    none |= dict.fromkeys(("ordinate_spec_data_type", "orddenom_spec_data_type", "z_axis_spec_data_type"), 0)
    none |= dict.fromkeys(
        ("abscissa_axis_units_lab", "orddenom_axis_units_lab", "z_axis_axis_units_lab"), "NONE"
    )
    for name, data in (("u1", TABLE), ("rel", RELATIVE)):
        one = pyuff.prepare_58(
            **none, binary=1, byte_ordering=1, fp_format=2, id1="test", id2=name, id3="NONE",
            id4="NONE", id5="NONE",
            func_type=1, ver_num=0, load_case_id=0, rsp_ent_name="TABLE", rsp_node=1, rsp_dir=1,
            ref_ent_name="NONE", ref_node=0, ref_dir=0, ord_data_type=4, num_pts=ROWS, abscissa_spacing=1,
            abscissa_min=0.0, abscissa_inc=1 / RATE_HZ, z_axis_value=0.0, abscissa_spec_data_type=17,
            ordinate_axis_units_lab="mm", data=data, x=TIME_S,
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets(one, mode="add")


def write_mdf(path):
    asammdf = pytest.importorskip("asammdf")
    signals = [
        asammdf.Signal(samples=data, timestamps=TIME_S, name=name, unit="mm")
        for name, data in (("u1", TABLE), ("rel", RELATIVE))
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        file.start_time = BEGUN
        file.save(path)


def write_hdf5(path):
    import h5py

    with h5py.File(path, "w") as file:
        file["raw/t"] = TIME_S
        file["raw/u1"] = TABLE
        file["raw/u1"].attrs["units"] = "mm"
        rows = np.zeros(ROWS, [("rel", "f8"), ("count", "i4")])
        rows["rel"] = RELATIVE
        file["raw/more"] = rows


def write_gzip(path):
    rows = zip(TIME_S.tolist(), TABLE.tolist(), RELATIVE.tolist(), strict=True)
    lines = "".join(f"{t!r},{u!r},{r!r}\n" for t, u, r in rows)
    path.write_bytes(gzip.compress(b"t,u1 [mm],rel\n" + lines.encode()))


ROUNDED = {"labview.lvm": 1e-16}
"""Formats of decimal digits, of which lvmio writes seventeen behind the point."""
FORMATS = {
    "matlab.mat": (write_matlab_73, FileLayout("t", "both:0", "both:1"), 1.0, None),
    "labview.tdms": (write_tdms, FileLayout("", "u1", "rel"), 1e-3, BEGUN),
    "labview.lvm": (write_lvm, FileLayout("", "u1", "rel"), 1e-3, BEGUN),
    "bench.uff": (write_universal, FileLayout("", "u1", "rel"), 1e-3, None),
    "vehicle.mf4": (write_mdf, FileLayout("", "u1", "rel"), 1e-3, BEGUN),
    "laboratory.hdf5": (write_hdf5, FileLayout("raw/t", "raw/u1", "raw/more.rel"), 1e-3, None),
    "packed.csv.gz": (write_gzip, FileLayout("t", "u1 [mm]", "rel"), 1e-3, None),
}


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_of_another_program_is_read_to_the_last_bit(tmp_path, name):
    write, layout, unit_m, start = FORMATS[name]
    path = tmp_path / name
    write(path)
    with shared_reading_process().read(path, ImportPlan(layout)) as record:
        for cells, written in zip(record.cells, (TABLE, RELATIVE), strict=True):
            assert np.abs(cells - written).max() <= ROUNDED.get(name, 0.0)
        assert record.time_s == pytest.approx(TIME_S, abs=1e-12)
        facts = record.facts
        assert facts.gauges[0].gain_m_per_count == unit_m
        assert facts.rate_hz == pytest.approx(RATE_HZ)
        assert facts.start == start
        assert facts.source.name == name
    found = shared_reading_process().survey(path, ParseOptions()).preview
    assert (found.time == "") == (layout.time == "")
    assert {layout.table, layout.second} <= set(found.columns)


def write_workbook(path, rows):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(path)
    book.close()


MAY_4 = datetime.datetime(2019, 5, 4)  # noqa: DTZ001 - a workbook has no zones
LATE = MAY_4 + datetime.timedelta(hours=23, minutes=59, seconds=59.5)
LATE_STAMPS = [LATE + datetime.timedelta(seconds=row / 4) for row in range(60)]


@pytest.mark.parametrize(
    ("names", "cells", "start"),
    [
        (["t"], [[one] for one in LATE_STAMPS], LATE.astimezone()),
        (["t"], [[one.time()] for one in LATE_STAMPS], None),
        (["t"], [[one - MAY_4] for one in LATE_STAMPS], None),
        (["t"], [[f"{one:%d.%m.%Y %H:%M:%S},{one.microsecond // 1000:03d}"] for one in LATE_STAMPS],
         LATE.astimezone()),
        (["t"], [[f"{one.isoformat()}+02:00"] for one in LATE_STAMPS],
         LATE.replace(tzinfo=datetime.timezone(datetime.timedelta(hours=2)))),
        (["t", "Date"], [[one.time(), MAY_4.replace(day=one.day)] for one in LATE_STAMPS],
         LATE.astimezone()),
    ],
)  # fmt: skip
def test_a_workbook_has_times_in_many_forms(tmp_path, names, cells, start):
    path = tmp_path / "log.xlsx"
    write_workbook(path, [[*names, "u1"], *([*cell, row] for row, cell in enumerate(cells))])
    plan = ImportPlan(FileLayout("t", "u1", date="Date" if "Date" in names else None))
    with shared_reading_process().read(path, plan) as record:
        assert record.time_s == pytest.approx(np.arange(60) / 4, abs=1e-9)
        assert record.facts.start == start


def test_a_workbook_is_read_whole_with_marks_and_progress(tmp_path):
    """Some programs write a wrong size of the sheet, beyond which openpyxl reads nothing."""
    whole, path = tmp_path / "whole.xlsx", tmp_path / "log.xlsx"
    marks = ["OVL", "N/A", -9999]
    write_workbook(
        whole, [["t", "u1"], ["s", "mm"], *([row / 4, (marks + [row] * 60)[row]] for row in range(60))]
    )
    with zipfile.ZipFile(whole) as given, zipfile.ZipFile(path, "w") as made:
        for name in given.namelist():
            made.writestr(name, given.read(name).replace(b'<dimension ref="A1:B62"', b'<dimension ref="A1"'))
    shares = []
    record = read_record(path, ImportPlan(FileLayout("t", "u1", missing=("ovl", "-9999"))), shares.append)
    assert np.isnan(record.cells[0][:3]).all()
    assert list(record.cells[0][3:]) == list(range(3, 60))
    assert record.facts.gauges[0].gain_m_per_count == 1e-3
    assert len(set(shares)) > 10
    assert shares == sorted(shares)


def test_a_look_into_a_large_file_shows_progress(tmp_path, monkeypatch):
    """Without it the reading process is ended after ten seconds, also where the time column is not named."""
    book, packed = tmp_path / "large.xlsx", tmp_path / "packed.csv.gz"
    write_workbook(book, [["t", "u1 [mm]"], *([at / 100, at] for at in range(1000))])
    write_gzip(packed)
    monkeypatch.setattr("app.runs.exchange.foreign_files._PIECE_BYTES", 1000)
    for path in (book, packed):
        shares = []
        preview_file(path, report=shares.append)
        assert len(shares) > 2
    named, found = [], []
    read_record(book, ImportPlan(FileLayout("t", "u1 [mm]")), named.append)
    read_record(book, ImportPlan(FileLayout("", "u1 [mm]")), found.append)
    assert len(found) > len(named) + 2


@pytest.mark.parametrize("suffix", [".xlsx", ".parquet", ".mat", ".h5"])
def test_units_and_times_are_found_in_the_names_of_any_format(tmp_path, suffix):
    columns = {"Test/Time (ms)": np.arange(60.0), "Test/u1_mm": np.arange(60.0)}
    path = tmp_path / f"log{suffix}"
    if suffix == ".xlsx":
        write_workbook(path, [list(columns), *np.column_stack(list(columns.values())).tolist()])
    elif suffix == ".parquet":
        parquet = pytest.importorskip("pyarrow.parquet")
        parquet.write_table(pytest.importorskip("pyarrow").table(columns), path)
    elif suffix == ".mat":
        from scipy.io import savemat

        columns = {"t_ms": np.arange(60.0), "u1_mm": np.arange(60.0)}
        savemat(path, columns)
    else:
        import h5py

        with h5py.File(path, "w") as file:
            file["at first"] = -np.arange(60.0)
            for name, values in columns.items():
                file[name] = values
    with shared_reading_process().read(path, ImportPlan(FileLayout("", list(columns)[1]))) as record:
        assert record.time_s == pytest.approx(1e-3 * np.arange(60))
        assert record.facts.gauges[0].gain_m_per_count == 1e-3


def test_date_times_of_a_table_are_its_times_whatever_their_name(tmp_path, monkeypatch):
    """As pandas keeps the index of a frame."""
    pandas = pytest.importorskip("pandas")
    index = pandas.date_range("2025-11-23 14:03:07", periods=60, freq="2ms", tz="UTC")
    path = tmp_path / "frame.parquet"
    pandas.DataFrame({"u1 [mm]": np.arange(60.0)}, index=index).to_parquet(path)
    record = read_record(path, ImportPlan(FileLayout("", "u1 [mm]")))
    assert record.facts.start == datetime.datetime(2025, 11, 23, 14, 3, 7, tzinfo=datetime.UTC)
    assert shared_reading_process().survey(path, ParseOptions()).preview.rows[1][0] == "1.0"


@pytest.mark.skipif(not hasattr(time, "tzset"), reason="the zone of the computer is changed")
def test_a_channel_of_date_times_is_utc_in_tdms(tmp_path, monkeypatch):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "stamped.tdms"
    stamps = np.datetime64("2025-11-23T14:03:07", "us") + np.arange(60) * np.timedelta64(2000, "us")
    with nptdms.TdmsWriter(path) as writer:
        channels = {"Time": stamps, "u1": np.arange(60.0)}
        writer.write_segment([nptdms.ChannelObject("g", name, data) for name, data in channels.items()])
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    try:
        record = read_record(path, ImportPlan(FileLayout("", "u1")))
    finally:
        monkeypatch.undo()
        time.tzset()
    assert record.facts.start == datetime.datetime(2025, 11, 23, 14, 3, 7, tzinfo=datetime.UTC)
    assert record.facts.rate_hz == pytest.approx(500.0)


def test_a_pickle_beside_a_labview_file_is_not_loaded(tmp_path):
    """lvm_read loads it whatever it is asked."""

    class Harmful:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "harm"),)

    write_lvm(tmp_path / "bench.lvm")
    (tmp_path / "bench.lvm.pkl").write_bytes(pickle.dumps(Harmful()))
    os.utime(tmp_path / "bench.lvm.pkl", (2e9, 2e9))
    with shared_reading_process().read(tmp_path / "bench.lvm", ImportPlan(FileLayout("", "u1"))) as record:
        assert len(record) == ROWS
    assert not (tmp_path / "harm").exists()


def test_the_first_segment_of_a_labview_file_is_read_in_parts_to_its_end(tmp_path, monkeypatch):
    """A cell is empty, rows have comments, and a second segment follows."""
    write_lvm(tmp_path / "one.lvm")
    lines = (tmp_path / "one.lvm").read_text().splitlines(keepends=True)
    first = next(at for at, line in enumerate(lines) if line.startswith("X_Value")) + 1
    cells = lines[first + 20].rstrip("\n").split("\t")
    cells[-1 if cells[-1] else -2] = ""
    lines[first + 20] = "\t".join(cells) + "\n"
    second = lines[first - 8 : first] + lines[first : first + 5]
    path = tmp_path / "two.lvm"
    path.write_text("".join([*lines[: first + ROWS], "\n", *second]))
    monkeypatch.setattr("app.runs.exchange.formats.labview._ROWS", 50)
    shares = []
    record = read_record(path, ImportPlan(FileLayout("", "u1", "rel")), shares.append)
    assert len(record) == ROWS
    assert np.abs(record.cells[0] - TABLE).max() < 1e-14
    assert np.flatnonzero(np.isnan(record.cells[1])).tolist() == [20]
    assert len(shares) >= ROWS // 50


def test_a_labview_file_may_have_decimal_commas(tmp_path):
    """Numbers go through numpy, and through lvm_read where a cell is empty."""
    lvmio = pytest.importorskip("lvmio")
    path, begun = tmp_path / "german.lvm", BEGUN.astimezone()
    channels = [
        lvmio.Channel(name, data.tolist(), "mm", delta_x=1 / RATE_HZ)
        for name, data in (("u1", TABLE), ("rel", RELATIVE))
    ]
    lvmio.write_lvm(
        path, channels, date=f"{begun:%Y/%m/%d}", time=f"{begun:%H:%M:%S,%f}", precision=17,
        decimal_separator=",",
    )  # fmt: skip
    rows = path.read_text().rstrip().splitlines()
    assert "." not in rows[-1]
    for is_whole in (True, False):
        if not is_whole:
            path.write_text("\n".join([*rows[:-1], rows[-1].replace(rows[-1].split("\t")[-1], ""), ""]))
        record = read_record(path, ImportPlan(FileLayout("", "u1", "rel")))
        assert np.abs(record.cells[0] - TABLE).max() < 1e-14
        assert np.abs(record.cells[1][:-1] - RELATIVE[:-1]).max() < 1e-14
        assert np.isnan(record.cells[1][-1]) != is_whole
        assert record.facts.rate_hz == pytest.approx(RATE_HZ)
        assert record.facts.start == BEGUN


def test_options_of_texts_are_refused_for_other_files(tmp_path):
    path = tmp_path / "log.xlsx"
    write_workbook(path, [["t", "u1"], *([row, row] for row in range(60))])
    assert (
        fault_of(path, FileLayout("t", "u1", encoding="cp1251"))
        == "log.xlsx is no text: leave out --encoding"
    )
    with_dates = fault_of(path, FileLayout("t", "u1", date="1"))
    assert "is given for" in with_dates


@pytest.mark.parametrize("name", ["wide.mat", "wide.h5"])
def test_rows_are_channels_where_a_matrix_has_too_many_columns(tmp_path, name):
    import h5py
    from scipy.io import savemat

    path, wide = tmp_path / name, np.stack([np.arange(300.0), np.arange(300.0) / 7])
    if name == "wide.mat":
        savemat(path, {"x": wide})
    else:
        with h5py.File(path, "w") as file:
            file["x"] = wide
    with shared_reading_process().read(path, ImportPlan(FileLayout("x:0", "x:1"))) as record:
        assert np.array_equal(record.time_s, wide[0])
        assert np.array_equal(record.cells[0], wide[1])


def test_a_sound_file_is_full_scale_times_a_gain(tmp_path):
    from scipy.io import wavfile

    path = tmp_path / "recorder.wav"
    counts = np.round(TABLE / 12.0 * 32767).astype(np.int16)
    wavfile.write(path, int(RATE_HZ), np.column_stack([counts, -counts]))
    plan = ImportPlan(FileLayout("", "channel 0", "channel 1"), gain=0.01)
    with shared_reading_process().read(path, plan) as record:
        assert np.array_equal(record.cells[0], counts / 32768.0)
        assert record.block.readings[:, 1] == pytest.approx(-0.01 * counts / 32768.0)
        assert record.facts.rate_hz == pytest.approx(RATE_HZ)
    assert "what one full scale means is not known. Add --gain" in fault_of(path, FileLayout("", "0"))


def fault_of(path, layout):
    """Text of the error that a file is refused with."""
    with pytest.raises(ImportFileError) as caught, shared_reading_process().read(path, ImportPlan(layout)):
        pass
    return str(caught.value)


def catman_file(channels):
    """A catman file as its description has it (`app.runs.exchange.formats.catman`)."""

    def text(value, code="h"):
        data = value.encode("cp1252")
        return struct.pack("<" + code, len(data)) + data

    heads, bodies = b"", b""
    for number, (name, unit, data, code) in enumerate(channels, start=1):
        extended = bytearray(148)
        extended[140] = code
        heads += struct.pack("<hi", number, len(data)) + text(name) + text(unit) + text("")
        heads += struct.pack("<hhd", 0, 8, 0.0) + struct.pack("<i", len(extended)) + bytes(extended)
        heads += b"00" + struct.pack("<Bd", 1, 2.5) + struct.pack("<h", 0) + text("") + text("T8", "i")
        if code == 2:
            low, high = float(data.min()), float(data.max())
            bodies += struct.pack("<dd", low, high)
            bodies += np.round((data - low) / (high - low) * 32767).astype("<u2").tobytes()
        else:
            bodies += data.astype({0: "<f8", 1: "<f4"}[code]).tobytes()
    head = text("a comment") + text("") * 32 + struct.pack("<hi", len(channels), 0)
    head += struct.pack(f"<{len(channels)}i", *[0] * len(channels)) + struct.pack("<i", 0) + heads
    return struct.pack("<hi", 5012, 6 + len(head)) + head + bodies


CATMAN = [("Time  1 - default", "s", TIME_S, 0), ("Tisch", "mm", TABLE, 1), ("Platte", "µm", RELATIVE, 2)]


def test_a_catman_file_is_read_in_all_its_widths(tmp_path):
    path = tmp_path / "old.bin"
    path.write_bytes(catman_file(CATMAN))
    plan = ImportPlan(FileLayout("", "Tisch", "Platte"))
    with shared_reading_process().read(path, plan) as record:
        assert np.array_equal(record.cells[0], TABLE.astype(np.float32))
        step = np.ptp(RELATIVE) / 32767
        assert np.abs(record.cells[1] - RELATIVE).max() <= step / 2 * (1 + 1e-9)
        assert np.array_equal(record.time_s, TIME_S)
        assert [gauge.gain_m_per_count for gauge in record.facts.gauges] == [1e-3, 1e-6]


CATMAN_FILES = Path(__file__).parent / "catman"


@pytest.mark.peer
@pytest.mark.parametrize(
    ("name", "channels"), json.loads((CATMAN_FILES / "apread.json").read_text("utf-8")).items()
)
def test_files_of_catman_hold_what_apread_reads_of_them(tmp_path, name, channels):
    path = tmp_path / name.removesuffix(".gz")
    path.write_bytes(gzip.decompress((CATMAN_FILES / name).read_bytes()))
    table = open_foreign(path, FileLayout("", ""))
    found = {}
    for at, (channel, unit) in enumerate(zip(table.names, table.units, strict=True)):
        values = np.asarray(table.column(at), "<f8")
        found[channel] = [unit, values[0], hashlib.sha256(values).hexdigest()]
    assert found == channels
    plan = ImportPlan(FileLayout("", "Baumer encoder 2500", "poti5k"), gain=1e-3)
    with shared_reading_process().read(CATMAN_FILES / name, plan) as record:
        assert len(record) == 100
        assert record.facts.rate_hz == pytest.approx(300.0, rel=1e-3)  # a step of two bytes is 10 us


@pytest.mark.peer
def test_apread_reads_the_same_of_a_catman_file(tmp_path):
    apread = pytest.importorskip("apread", exc_type=ImportError)
    path = tmp_path / "old.bin"
    path.write_bytes(catman_file(CATMAN))
    channels = {channel.Name: channel.data for channel in apread.APReader(str(path)).Channels}
    with shared_reading_process().read(path, ImportPlan(FileLayout("", "Tisch", "Platte"))) as record:
        assert np.array_equal(channels["Tisch"], record.cells[0])
        assert np.array_equal(channels["Platte"], record.cells[1])


def hostile_files(folder: Path) -> dict[str, bytes]:
    """A hostile file of each format: cut, huge by its own word, or a bomb."""
    made = {}
    for name, (write, *_) in FORMATS.items():
        write(folder / name)
        data = (folder / name).read_bytes()
        made[f"cut {name}"] = data[: len(data) * 2 // 3]
        made[f"scrambled {name}"] = data[:100] + bytes(byte ^ 0xA5 for byte in data[100:])
    made["cut old.bin"] = catman_file(CATMAN)[:-100]
    made["huge old.bin"] = catman_file(CATMAN).replace(struct.pack("<i", ROWS), struct.pack("<i", 2**31 - 1))
    made["empty.wav"] = b"RIFF\xff\xff\xff\xffWAVEfmt \x10\0\0\0\x01\0\x02\0"
    made["huge.h5"] = huge_hdf5(folder)
    return made


def huge_hdf5(folder: Path) -> bytes:
    """100 GB of zeros in 2 kB."""
    import h5py

    with h5py.File(folder / "zeros.h5", "w") as file:
        for name in ("t", "u1"):
            file.create_dataset(name, (12_500_000_000,), "f8", chunks=(1 << 20,), compression="gzip")
    return (folder / "zeros.h5").read_bytes()


def read_or_fault(path, layout):
    """Name and text of the fault of a file, or its name where it can be read in spite of all."""
    try:
        with shared_reading_process().read(path, ImportPlan(layout)) as record:
            assert len(record) <= ROWS
            return path.name
    except ImportFileError as error:
        return str(error)


def test_every_hostile_file_is_one_line_and_the_next_file_is_read(tmp_path):
    sound = tmp_path / "sound.csv.gz"
    write_gzip(sound)
    layouts = {Path(name).suffix: layout for name, (_, layout, *_) in FORMATS.items()}
    layouts[".bin"] = FileLayout("", "Tisch", "Platte")
    for name, data in hostile_files(tmp_path).items():
        path = tmp_path / name
        path.write_bytes(data)
        layout = layouts.get(path.suffix, FileLayout("t", "u1"))
        said = read_or_fault(path, layout)
        assert said.count("\n") == 0, name
        assert len(said) < 600, name
        assert path.name in said, name
        with shared_reading_process().read(sound, ImportPlan(FileLayout("t", "u1 [mm]"))) as record:
            assert np.array_equal(record.cells[0], TABLE)


def test_the_process_that_read_a_large_record_frees_its_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(reading_process, "_LARGE_BYTES", ROWS)
    path, process = tmp_path / "large.csv.gz", ReadingProcess()
    write_gzip(path)
    try:
        for _ in range(2):
            with process.read(path, ImportPlan(FORMATS["packed.csv.gz"][1])) as record:
                assert process._process.pid is None
                assert np.array_equal(record.time_s, TIME_S)
    finally:
        process.stop()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a file that never ends is a pipe here")
def test_a_reader_without_progress_is_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(reading_process, "PROGRESS_S", 0.5)
    path = tmp_path / "endless.csv"
    os.mkfifo(path)
    reader = ReadingProcess()
    try:
        fault = pytest.raises(ImportFileError, match=r"endless.csv: reading it shows no progress for 0.5 s")
        with fault, reader.read(path, ImportPlan(FileLayout("t", "u1"))):
            pass
    finally:
        reader.stop()
