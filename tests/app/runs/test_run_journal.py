import pytest

from app.runs.journal import MAGIC, RecordKind, encode_record, has_record_behind, read_journal


def test_a_journal_reads_back_up_to_its_first_torn_record(tmp_path):
    path = tmp_path / "a.journal"
    records = [
        encode_record(b"one", 1),
        encode_record(b'{"a": 1}', 2, RecordKind.NOTE),
        encode_record(b"", 3),
    ]
    whole = MAGIC + b"".join(records)
    path.write_bytes(whole)

    read = list(read_journal(path))
    assert [(r.kind, r.arrival_ns, r.data) for r in read] == [
        (RecordKind.WIRE, 1, b"one"),
        (RecordKind.NOTE, 2, b'{"a": 1}'),
        (RecordKind.WIRE, 3, b""),
    ]
    assert read[-1].end == len(whole)
    assert list(read_journal(path, read[0].end)) == read[1:]
    for cut in range(len(MAGIC), len(whole)):
        path.write_bytes(whole[:cut])
        assert list(read_journal(path)) == [r for r in read if r.end <= cut]


@pytest.mark.parametrize("at", range(len(MAGIC), len(MAGIC + encode_record(b"one", 1))))
def test_a_flipped_bit_ends_a_journal(tmp_path, at):
    path = tmp_path / "a.journal"
    data = bytearray(MAGIC + encode_record(b"one", 1) + encode_record(b"two", 2))
    data[at] ^= 0x40
    path.write_bytes(data)
    assert list(read_journal(path)) == []


def test_another_file_is_no_journal(tmp_path):
    (tmp_path / "a").write_bytes(b"time,table\n1,2\n")
    with pytest.raises(ValueError, match="not a Slipstand journal"):
        list(read_journal(tmp_path / "a"))


def test_a_whole_record_behind_a_torn_one_is_seen(tmp_path):
    path, torn = tmp_path / "a.journal", encode_record(b"one", 1)[:-1]
    path.write_bytes(MAGIC + torn)
    assert not has_record_behind(path, len(MAGIC))
    path.write_bytes(MAGIC + bytes(5000))
    assert not has_record_behind(path, len(MAGIC))
    path.write_bytes(MAGIC + torn + bytes(500) + encode_record(b"two", 2))
    assert has_record_behind(path, len(MAGIC))
    path.write_bytes(MAGIC + bytes(2 << 20))
    assert has_record_behind(path, len(MAGIC)), "so much is searched by nobody, and stays"
