"""Streams of a Modbus transmitter: responses in envelopes."""

from drivers.devices.modbus.decoder import ResponseDecoder, wrap_response
from drivers.devices.modbus.frames import encode_read_response
from drivers.devices.modbus.maps import read_map
from drivers.devices.modbus.registers import Framing, plan_poll
from drivers.devices.modbus.tcp_frames import with_header
from tests.drivers.examples import RATE_HZ, Counts, RecordingExample, WireExample

CHANNELS = tuple(read_map("generic", {}).channels.values())
POLL = plan_poll(CHANNELS)
(REQUEST,) = POLL.requests


def decoder() -> ResponseDecoder:
    return ResponseDecoder(POLL, (0, 1), RATE_HZ)


def responses(first: int, counts: Counts) -> list[bytes]:
    return [
        encode_read_response(REQUEST.unit, REQUEST.function, row.astype(">i4").tobytes()) for row in counts
    ]


def tcp_decoder() -> ResponseDecoder:
    return ResponseDecoder(plan_poll(CHANNELS, Framing.TCP), (0, 1), RATE_HZ)


def tcp_responses(first: int, counts: Counts) -> list[bytes]:
    return [with_header((first + i) % 65536, rtu[:-2]) for i, rtu in enumerate(responses(first, counts))]


def envelope(index: int, response: bytes) -> bytes:
    return wrap_response(0, round((index + 0.5) * 1e9 / RATE_HZ), response)


def enveloped(first: int, counts: Counts) -> list[bytes]:
    return [envelope(first + i, response) for i, response in enumerate(responses(first, counts))]


WIRE = (
    WireExample("modbus", decoder, responses, has_checksum=True, envelope=envelope),
    WireExample("modbus tcp", tcp_decoder, tcp_responses, has_checksum=False, envelope=envelope),
    WireExample("modbus, damaged envelopes", decoder, enveloped, has_checksum=True),
)
RECORDING = RecordingExample(
    "Modbus RTU, 115200 baud",
    rates_hz=(20, 50, 100, 150, 200, 250, 300, 350),
    is_exact=False,
    polled_hz=100.0,
)
VARIANTS = {
    "modbus-tcp": RecordingExample(
        "Modbus TCP",
        rates_hz=(100, 200, 250, 300, 350, 400, 500, 600, 700, 800),
        is_exact=False,
        polled_hz=100.0,
        settings={"framing": "tcp"},
    )
}
