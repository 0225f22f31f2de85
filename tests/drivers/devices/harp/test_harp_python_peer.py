"""harp-python, the reader of the Harp project, decodes what our simulated device sends."""

import numpy as np
import pytest

from drivers.devices.harp.codec import START, STOP, EventDecoder, encode_events, encode_write
from drivers.devices.harp.codec import Register as OurRegister
from drivers.devices.harp.simulated import SimulatedHarp, find_commands
from drivers.devices.harp.source import HarpSettings
from drivers.simulated.protocol import Command, CommandParser

harp = pytest.importorskip("harp.io", reason="harp-python is not installed")


def test_the_peer_decodes_the_same_samples_from_our_bytes():
    times_s = 1000.0 + np.arange(500) / 1000.0
    counts = np.stack([np.arange(500) * 50 - 12_000, 9_000 - 37 * np.arange(500)], axis=1)
    wire = encode_events(times_s, counts, table=2, relative=5).tobytes()
    theirs = harp.read(wire, address=33, dtype=np.dtype(np.int16), length=8, keep_type=True)
    assert set(theirs["MessageType"]) == {"EVENT"}
    (ours,) = EventDecoder(1000.0, 2, 5).feed(wire, 0)
    np.testing.assert_array_equal(theirs[[2, 5]].to_numpy(), ours.counts)
    np.testing.assert_allclose(theirs.index.to_numpy() - theirs.index[0], ours.device_time_s, atol=1e-9)


def test_we_decode_what_the_peer_writes():
    pandas = pytest.importorskip("pandas")
    times_s = np.arange(100) * 32e-6 * 31
    counts = np.arange(800, dtype=np.int16).reshape(100, 8) - 400
    frame = pandas.DataFrame(counts, index=pandas.Index(times_s))
    wire = harp.to_buffer(frame, address=33, message_type=harp.MessageType.EVENT).tobytes()
    (block,) = EventDecoder(1 / (32e-6 * 31), 0, 7).feed(wire, 0)
    np.testing.assert_array_equal(block.counts, counts[:, [0, 7]])
    assert not block.status.any()


@pytest.mark.parametrize(
    ("request_bytes", "kind"),
    [
        (START, "WRITE"),
        (STOP, "WRITE"),
        (encode_write(OurRegister.OPERATION, 0xE1), "WRITE"),
    ],
    ids=["start", "stop", "write of a register"],
)
def test_the_peer_reads_our_replies(request_bytes, kind):
    device = SimulatedHarp(HarpSettings())
    (command,) = CommandParser(find_commands).feed(request_bytes)
    reply = device.respond(command, True, 1000.0)
    said = harp.read(reply, address=command.code, dtype=np.dtype(np.uint8), length=1, keep_type=True)
    assert said["MessageType"].tolist() == [kind]
    assert said[0].tolist() == [request_bytes[5]]


def test_the_peer_reads_who_we_are():
    reply = SimulatedHarp(HarpSettings()).respond(Command(None, code=0, parameters=b"\x01"), True, 1000.0)
    assert harp.read(reply, address=0, dtype=np.dtype(np.uint16), length=1)[0].tolist() == [1232]
