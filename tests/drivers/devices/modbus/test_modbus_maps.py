import struct

import pytest
from modbus_kit import poll_for

from drivers.devices.modbus.frames import Function, Request
from drivers.devices.modbus.maps import read_map, shipped_maps
from drivers.devices.modbus.registers import (
    ByteOrder,
    Channel,
    ChannelValue,
    Framing,
    ValueType,
    decode_channel,
    encode_channel,
)
from drivers.errors import SettingsError


def test_the_shipped_maps_can_be_read():
    assert shipped_maps() == [
        "flintec-dad141", "generic", "laumas-ethernet", "laumas-tlb4", "scaime-enod4",
        "scaime-enod4-ethernet",
    ]  # fmt: skip
    for name in shipped_maps():
        assert set(read_map(name, {}).channels) == {"table", "relative"}


def test_the_generic_map_needs_one_request():
    poll = poll_for()
    assert poll.requests == (Request(1, Function.READ_HOLDING, 0, 4),)
    answers = [struct.pack(">ii", 70_000, -5)]
    assert [reading.counts for reading in poll.channel_values(answers)] == [70_000.0, -5.0]


def test_two_transmitters_on_one_bus_need_two():
    poll = poll_for(map="laumas-tlb4")
    assert poll.requests == (Request(1, Function.READ_HOLDING, 6, 3), Request(2, Function.READ_HOLDING, 6, 3))
    answers = [struct.pack(">Hi", 0x80, 70_000), struct.pack(">Hi", 0x08, 123)]
    table, relative = poll.channel_values(answers)
    assert table == ChannelValue(-70_000.0)  # bit 7: negative
    assert relative == ChannelValue(123.0, is_overloaded=True)
    (broken,) = poll_for(map="laumas-tlb4", channel="table").channel_values([struct.pack(">Hi", 1, 0)])
    assert broken.is_faulty


def test_the_status_of_an_enod4():
    poll = poll_for(map="scaime-enod4")
    bits = {0b0000: (False, False), 0b0100: (False, True), 0b1000: (True, False), 0b1100: (True, True)}
    bits |= {0b1_0000: (False, False), 0b100_0000: (False, True)}  # at rest; EEPROM failure
    for word, (is_overloaded, is_faulty) in bits.items():
        reading = poll.channel_values([struct.pack(">Hi", word, 9)] * 2)[0]
        assert (reading.is_overloaded, reading.is_faulty) == (is_overloaded, is_faulty)
    assert [(one.register, one.count) for one in poll.requests] == [(0x7D, 3), (0x7D, 3)]
    assert not read_map("scaime-enod4", {}).caution


def test_a_dad141_is_read_in_one_request():
    """Gross weight, net weight and qualifier of the combined result lie side by side from 3300h on."""
    poll = poll_for(map="flintec-dad141", channel="relative")
    assert [request.body for request in poll.requests] == [bytes.fromhex("01 03 33 00 00 05")]
    words = {0x0000: (False, False), 0x0001: (True, False), 0x0002: (True, False), 0x0130: (False, False)}
    for word, (is_overloaded, is_faulty) in words.items():
        (reading,) = poll.channel_values([struct.pack(">iiH", -70_000, 5, word)])
        assert reading == ChannelValue(-70_000.0, is_overloaded, is_faulty)


def test_a_map_is_based_on_another():
    ethernet, serial = read_map("laumas-ethernet", {}), read_map("laumas-tlb4", {})
    assert (ethernet.framing, serial.framing) == (Framing.TCP, Framing.RTU)
    assert ethernet.channels["table"] == serial.channels["table"]
    assert ethernet.channels["relative"] == ethernet.channels["table"]


def test_registers_that_do_not_touch_are_read_apart():
    assert poll_for(relative_register="3").requests == (
        Request(1, Function.READ_HOLDING, 0, 2),
        Request(1, Function.READ_HOLDING, 3, 2),
    )
    overlapping = poll_for(relative_register="1")
    assert overlapping.requests == (Request(1, Function.READ_HOLDING, 0, 3),)
    far = poll_for(status_register="200")
    assert [(request.register, request.count) for request in far.requests] == [(0, 4), (200, 1)]
    assert len(poll_for(relative_function="4").requests) == 2


def test_what_is_given_stands_above_the_map():
    channel = read_map(
        "generic", {"unit": "9", "relative_unit": "0x0A", "scale": "0.5", "overload_bits": "2,3",
                    "status_register": "8"}
    ).channels  # fmt: skip
    assert (channel["table"].unit, channel["relative"].unit) == (9, 10)
    assert channel["table"].scale == 0.5
    assert (channel["table"].status_register, channel["table"].overload_bits) == (8, (2, 3))


@pytest.mark.parametrize(
    ("order", "wire"),
    [("ABCD", "0001e240"), ("CDAB", "e2400001"), ("BADC", "010040e2"), ("DCBA", "40e20100")],
)
def test_the_order_of_words_and_bytes(order, wire):
    """123456 is 0001E240; the names are those of the manuals: A is the most significant byte."""
    channel = Channel(1, Function.READ_HOLDING, 0, ValueType.INT32, ByteOrder(order))
    assert decode_channel(channel, bytes.fromhex(wire), 0).counts == 123456
    assert encode_channel(channel, ChannelValue(123456.0))[0] == bytes.fromhex(wire)


@pytest.mark.parametrize(
    ("kind", "order", "wire", "counts"),
    [
        ("int16", "ABCD", "fffe", -2.0),
        ("uint16", "ABCD", "fffe", 65534.0),
        ("int16", "BADC", "feff", -2.0),
        ("uint32", "ABCD", "fffffffe", 4294967294.0),
        ("float32", "ABCD", "c0490fdb", -3.1415927410125732),
        # Líder Balanças LD2051 manual 2.7, as quoted by mbmap-library: 500 and 0.5, low word first
        ("int32", "CDAB", "01f40000", 500.0),
        ("float32", "CDAB", "00003f00", 0.5),
    ],
)
def test_types(kind, order, wire, counts):
    channel = Channel(1, Function.READ_HOLDING, 0, ValueType(kind), ByteOrder(order))
    assert decode_channel(channel, bytes.fromhex(wire), 0) == ChannelValue(counts)
    assert encode_channel(channel, ChannelValue(counts))[0] == bytes.fromhex(wire)


@pytest.mark.parametrize(("kind", "wire"), [("int16", "7fff"), ("int16", "8000"), ("uint32", "ffffffff")])
def test_a_reading_at_the_end_of_its_type_is_clipped(kind, wire):
    channel = Channel(1, Function.READ_HOLDING, 0, ValueType(kind))
    assert decode_channel(channel, bytes.fromhex(wire), 0).is_overloaded


@pytest.mark.parametrize("wire", ["7fc00000", "7f800000", "ff800000"])
def test_a_float_that_is_no_number_is_a_fault(wire):
    channel = Channel(1, Function.READ_HOLDING, 0, ValueType.FLOAT32)
    assert decode_channel(channel, bytes.fromhex(wire), 0).is_faulty


def test_a_map_of_your_own(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text(
        'title = "Own"\ncaution = "mind the gap"\nfunction = 4\nunit = 3\n'
        "[table]\nregister = 10\ntype = 'float32'\n"
        "[relative]\nregister = 0x20\nscale = -1.5\n"
    )
    found = read_map(str(own), {})
    assert (found.title, found.caution) == ("Own", "mind the gap")
    table, relative = found.channels["table"], found.channels["relative"]
    assert (table.unit, table.function, table.register, table.kind) == (3, 4, 10, ValueType.FLOAT32)
    assert (relative.register, relative.kind, relative.scale) == (32, ValueType.INT32, -1.5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("unit = 300\n", "map FILE: unit = 300 cannot be: give a whole number from 1 to 247"),
        ("unit = 1\n[table]\nregister = 'x'\n", "table.register = 'x' cannot be: give a whole number"),
        ("unit = 1\n[table]\nregister = 70000\n", "table.register = 70000 cannot be"),
        ("unit = 1\nregister = true\n", "register = True cannot be"),
        ("unit = 1\nregister = 0\ntype = 'int24'\n", "type = 'int24' cannot be: give one of int16, uint16"),
        ("unit = 1\nregister = 0\norder = 'CADB'\n", "order = 'CADB' cannot be: give one of ABCD, CDAB"),
        ("unit = 1\nregister = 0\nfunction = 6\n", "function = 6 cannot be: give 3 or 4"),
        ("unit = 1\nregister = 0\nscale = 0\n", "scale = 0 cannot be: give a number that is not 0"),
        ("unit = 1\nregister = 0\nscale = nan\n", "scale = nan cannot be"),
        ("unit = 1\nregister = 0\noverload_bits = [16]\n", "overload_bits = [16] cannot be: give bits"),
        ("unit = 1\nregister = 0\noverload_bits = 3\n", "overload_bits = 3 cannot be"),
        ("unit = 1\nregister = 0\nzero_register = 5\n", "table.zero_value is missing"),
        ("unit = 1\n", "table.register is missing: give it in the map, or --set table_register=NUMBER"),
        ("registers = 7\n", "registers = 7 is not known: allowed are base, title, source, peer, framing"),
        ("[table]\nadress = 7\n", "table.adress = 7 is not known: allowed are unit, function"),
        ("table = 7\n", "table = 7 is no table: write [table] and its keys below"),
        ("title = 7\n", "title = 7 is no line of text"),
        ("unit = 1\nregister = 0\nframing = 'udp'\n", "framing = 'udp' cannot be: give one of rtu, tcp"),
        ("base = 'kern'\n", "base = 'kern' cannot be: give one of flintec-dad141, generic"),
        ("unit = = 1\n", "is no TOML (Invalid value"),
    ],
)  # fmt: skip
def test_a_bad_map_is_one_clear_line(tmp_path, text, said):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(SettingsError) as error:
        read_map(str(path), {})
    assert said.replace("FILE", str(path)) in str(error.value)
    assert str(error.value).startswith(f"map {path}")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (
            "laumas",
            "map 'laumas' is not known: give one of flintec-dad141, generic, laumas-ethernet, laumas-tlb4,",
        ),
        ("nowhere.toml", "map nowhere.toml cannot be read (No such file or directory): check its path"),
    ],
)
def test_a_map_that_is_not_there(name, said):
    with pytest.raises(SettingsError) as error:
        read_map(name, {})
    assert said in str(error.value)


def test_a_map_that_is_no_text(tmp_path):
    path = tmp_path / "bytes.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SettingsError, match="is no TOML"):
        read_map(str(path), {})
