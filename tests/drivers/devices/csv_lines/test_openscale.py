import pytest
from wire_helpers import ScriptedLink, join

from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.devices.csv_lines.inference import find_openscale_format
from drivers.devices.csv_lines.source import OpenScaleSource, make_source
from drivers.errors import NoDataError, SettingsError

C = Column
BANNER = (
    b"OpenScale by SparkFun Electronics\r\nFirmware version 1.2\r\nMinimum time between reports: 58\r\n"
    b"Press x to bring up settings\r\nReadings:\r\n"
)


def lines(form: str, count: int = 30, first_ms: int = 2000) -> bytes:
    """Reports as firmware 1.2 or 1.0 prints them, ten a second."""
    rows = (form.format(ms=first_ms + 100 * k, value=k / 4, raw=8355808 + k) for k in range(count))
    return "".join(row + "\r\n" for row in rows).encode()


FORMS = {
    "{ms},{value:.2f},lbs,": (C.TIME_MS, C.VALUE, C.UNIT, C.EMPTY),
    "{ms},{value:.2f},kg,24.06,0,": (C.TIME_MS, C.VALUE, C.UNIT, C.IGNORE, C.IGNORE, C.EMPTY),
    "{ms},{value:.4f},kg,{raw},": (C.TIME_MS, C.VALUE, C.UNIT, C.IGNORE, C.EMPTY),
    "{value:.2f},kg,": (C.VALUE, C.UNIT, C.EMPTY),
    "{value:.2f},lbs,{raw},24.06,": (C.VALUE, C.UNIT, C.IGNORE, C.IGNORE, C.EMPTY),
    "{ms},24.06,0,{value:.2f},lbs": (C.TIME_MS, C.IGNORE, C.IGNORE, C.VALUE, C.UNIT),
    "0,{value:.2f},kg": (C.IGNORE, C.VALUE, C.UNIT),
    "24.06,{value:.2f},kg": (C.IGNORE, C.VALUE, C.UNIT),
}
"""The last three are of firmware 1.0, the last two without a time."""


@pytest.mark.parametrize(("form", "columns"), FORMS.items())
def test_the_columns_that_are_switched_on_show_in_the_lines(form, columns):
    layout = find_openscale_format(BANNER + lines(form))
    assert layout is not None
    assert layout.columns == columns
    assert layout.unit == ("lbs" if "lbs" in form else "kg")


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_readings_come_through_in_any_cut(form, size):
    source = make_source({"format": "openscale"}, None if "{ms}" in form else 10.0)
    data = BANNER + lines(form)
    reads = [data[at : at + size] for at in range(0, len(data), size)]
    block = join(block for read in reads for block in source.decode(read, 0))
    assert block.counts[:, 0].tolist() == [k / 4 for k in range(30)]
    assert not block.counts[:, 1].any()
    assert not block.status.any()
    assert source.rate_hz == pytest.approx(10)


def test_the_time_is_a_signed_number():
    assert find_openscale_format(lines("{ms},{value:.2f},kg,", first_ms=-500)).columns[0] is C.TIME_MS


@pytest.mark.parametrize(
    "data",
    [
        b"",
        BANNER,
        lines("{ms},{value:.2f},kg,", count=2),
        lines("{ms},{value:.2f},stone,"),
        lines("{ms},{value:.2f}"),
        lines("kg,{value:.2f},"),
        lines("{ms},,{value:.2f},kg,"),
        lines("{ms},{value:.2f},kg,lbs,"),
        lines("{ms},{value:.2f},kg,--,"),
        lines("{ms},{value:.2f},kg,", count=2) + b"2200,\xff.5,kg,\r\n",
    ],
)
def test_what_is_none_of_its_lines(data):
    assert find_openscale_format(data) is None


def test_after_the_unit_is_known_another_one_breaks_the_line():
    source = make_source({"format": "openscale"}, None)
    data = b"gs:\n" + lines("{ms},{value:.2f},kg,") + b"5000,7.25,lbs,\r\n5100,7.75,kg,\r\n"
    block = join(source.decode(data + b"5200,8.0,kg,\r\n", 0))
    assert block.status.tolist() == [0] * 30 + [2, 0, 0]
    assert source.losses.damaged == 1


@pytest.mark.parametrize("damage", [b"50x0,1.0,kg,\r\n", b"5000,1.0,k\r\n", b"5000,1.0,kg,5000,1.0,kg,\r\n"])
def test_a_damaged_line_becomes_a_damaged_row(damage):
    source = make_source({"format": "openscale"}, None)
    after = b"5100,7.75,kg,\r\n5200,8.0,kg,\r\n"
    block = join(source.decode(b"gs:\n" + lines("{ms},{value:.2f},kg,") + damage + after, 0))
    assert block.status.tolist() == [0] * 30 + [2, 0, 0]


def test_start_waits_out_reset_and_banner(monkeypatch):
    monkeypatch.setattr(OpenScaleSource, "timeout_s", 0.3)
    link = ScriptedLink(lambda _: b"", b"old" + BANNER + lines("{ms},{value:.2f},kg,"))
    source = make_source({"format": "openscale"}, None)
    source.start(link)
    assert source.rate_hz == pytest.approx(10)
    assert source.identity.name == "SparkFun OpenScale"
    assert link.sent == []


def test_without_a_time_it_wants_a_rate(monkeypatch):
    monkeypatch.setattr(OpenScaleSource, "timeout_s", 0.3)
    with pytest.raises(SettingsError, match="do not tell their rate: give --rate"):
        make_source({"format": "openscale"}, None).start(
            ScriptedLink(lambda _: b"", b"x" * 50 + BANNER + lines("{value:.2f},kg,"))
        )


def test_its_menu_is_no_data(monkeypatch):
    monkeypatch.setattr(OpenScaleSource, "timeout_s", 0.1)
    menu = b"\r\nSystem Configuration\r\n1) Tare scale to zero [1000]\r\n" * 3
    with pytest.raises(NoDataError, match="lines such as"):
        make_source({"format": "openscale"}, None).start(ScriptedLink(lambda _: b"", menu))


def test_nothing_else_is_set_beside_the_format():
    with pytest.raises(SettingsError, match="format openscale finds columns by itself: leave columns out"):
        make_source({"format": "openscale", "columns": "time_ms,value"}, None)


def test_units_and_empty_fields_can_be_given_as_columns_too():
    layout = LineFormat((C.TIME_MS, C.IGNORE, C.UNIT, C.VALUE, C.EMPTY), unit="kg")
    source = make_source({"columns": "time_ms,ignore,unit,value,empty", "unit": "kg"}, None)
    block = join(source.decode(lines("{ms},{value:.2f},kg,{raw},"), 0))
    assert block.counts[:, 0].tolist() == [8355808 + k for k in range(1, 30)]
    assert layout.channels == 1
    with pytest.raises(SettingsError, match="unit 'k9' is no word"):
        make_source({"unit": "k9"}, None)
