import pytest

from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.errors import SettingsError

C = Column


@pytest.mark.parametrize(
    ("parts", "fault"),
    [
        (
            {"columns": (C.TIME_US, C.TABLE)},
            "time_us,table need table and relative exactly once each, or value alone",
        ),
        ({"columns": (C.VALUE, C.TABLE)}, "or value alone"),
        ({"columns": (C.TABLE, C.TABLE, C.RELATIVE)}, "need table and relative exactly once each"),
        ({"columns": (C.TIME_US, C.TIME_S, C.TABLE, C.RELATIVE)}, "more than one time"),
        ({"columns": (C.SEQUENCE, C.SEQUENCE, C.TABLE, C.RELATIVE)}, "more than one time or sequence"),
        ({"columns": (C.CRC, C.TABLE, C.RELATIVE)}, "can only be the last"),
        ({"separator": ""}, "separator ''"),
        ({"separator": ", "}, "separator ', '"),
        ({"separator": "4"}, "cannot part numbers"),
        ({"decimal": ";"}, "decimal ';' is not known: give . or ,"),
        ({"decimal": ","}, "separator and decimal are both ','"),
        ({"time_bits": 4}, "time_bits 4 is out of range"),
        ({"sequence_bits": 64}, "sequence_bits 64 is out of range"),
    ],
)
def test_parts_that_contradict_each_other(parts, fault):
    with pytest.raises(SettingsError) as error:
        LineFormat(**parts)
    assert fault in str(error.value)


def test_what_wraps_where():
    assert LineFormat().time_wrap == 2**32
    assert LineFormat(time_bits=0).time_wrap == 0
    assert LineFormat((C.TIME_S, C.TABLE, C.RELATIVE)).time_wrap == 0
    assert LineFormat((C.TABLE, C.RELATIVE)).time_wrap == 0
    assert LineFormat(sequence_bits=8).sequence_wrap == 256
