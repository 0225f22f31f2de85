"""How fast bytes become samples: our decoders against plain loops, in one run, by processor time.

Run it with `python benchmarks/decoders.py`; it prints the tables of docs/benchmarks.md.
"""

import binascii
import io
import os
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
import serial

from drivers.devices.csv_lines.codec import LineDecoder, encode_line, encode_lines
from drivers.devices.csv_lines.columns import Column, LineFormat
from drivers.devices.csv_lines.inference import OPENSCALE_FORMAT
from drivers.devices.dataq.codec import WITH_DIGITAL, ScanDecoder, encode_scans
from drivers.devices.gsv.codec import FrameDecoder as GsvDecoder
from drivers.devices.gsv.codec import FrameLayout, ValueKind
from drivers.devices.gsv.codec import encode_frames as encode_gsv
from drivers.devices.gsv_234.codec import FORMATS as GSV_FORMATS
from drivers.devices.gsv_234.codec import FrameDecoder as Gsv234Decoder
from drivers.devices.gsv_234.codec import encode_frames as encode_gsv_234
from drivers.devices.harp.codec import EventDecoder, encode_events
from drivers.devices.hbm_aed.codec import Format as HbmFormat
from drivers.devices.hbm_aed.codec import ValueDecoder as HbmDecoder
from drivers.devices.hbm_aed.codec import encode_frames as encode_hbm
from drivers.devices.modbus.decoder import ResponseDecoder, wrap_response
from drivers.devices.modbus.frames import encode_read_response
from drivers.devices.modbus.maps import read_map
from drivers.devices.modbus.registers import Poll, plan_poll
from drivers.devices.slipstand_binary.codec import FrameDecoder, encode_frames
from drivers.envelope import wrap
from drivers.pair.source import make_pair
from drivers.registry import find_driver
from drivers.samples import SampleBlock
from drivers.source import Decoder

RATE_HZ = 2000.0
FEEDER = "import sys; sys.stdout.buffer.write(sys.stdin.buffer.read())"
REPEATS = 15
SAMPLES = 640_000
PLAIN_SAMPLES = 64_000
PORT_LINES = 20_000
READ_LINES = 20
PLAIN = LineFormat()
CHECKED = LineFormat((Column.TIME_US, Column.TABLE, Column.RELATIVE, Column.CRC))


def main() -> None:
    counts = np.random.default_rng(1).integers(-(2**23), 2**23, (SAMPLES, 2)).astype(np.int32)
    report_binary(counts)
    report_lines(counts)
    report_amplifiers(counts)
    report_small_reads(counts)


def report_binary(counts: np.ndarray) -> None:
    print("| Slipstand binary | frames/s | samples/s | against the struct loop |")
    print("|---|---|---|---|")
    for n in (1, 10, 32):
        frames = SAMPLES // n
        wire = encode_frames(0, np.arange(frames) * round(n * 1e6 / RATE_HZ), counts).tobytes()
        damaged = with_damage(wire, len(wire) // frames)
        plain = wire[: PLAIN_SAMPLES // n * (len(wire) // frames)]
        loop = PLAIN_SAMPLES / best_s(lambda data=plain: struct_loop(data))
        for name, data in (("", wire), (", 2 % damaged", damaged)):
            ours = SAMPLES / best_s(lambda data=data: decode_frames(data))
            print(f"| n = {n}{name} | {millions(ours / n)} | {millions(ours)} | {ours / loop:.0f} x |")
        print(f"| n = {n}, struct loop | {millions(loop / n)} | {millions(loop)} | 1 |")
    print()


def report_lines(counts: np.ndarray) -> None:
    print("| CSV lines | lines/s | against readline on a port |")
    print("|---|---|---|")
    times_s = np.arange(SAMPLES) / RATE_HZ
    plain = b"".join(encode_lines(PLAIN, times_s, counts))
    checked = b"".join(encode_lines(CHECKED, times_s, counts))
    few = b"".join(encode_lines(PLAIN, times_s[:PLAIN_SAMPLES], counts[:PLAIN_SAMPLES]))
    figures = {
        "time, two values": lines_per_s(PLAIN, plain),
        "time, two values, 2 % damaged": lines_per_s(PLAIN, with_damage(plain, 27)),
        "time, two values, CRC": lines_per_s(CHECKED, checked),
        "time, two values, CRC, 2 % damaged": lines_per_s(CHECKED, with_damage(checked, 32)),
        "OpenScale, time in ms": lines_per_s(
            OPENSCALE_FORMAT, b"".join(encode_lines(OPENSCALE_FORMAT, times_s, counts))
        ),
        "readline loop in memory": PLAIN_SAMPLES / best_s(lambda: readline_loop(io.BytesIO(few))),
    }
    slowest = port_lines_per_s(few) if os.name == "posix" else None
    if slowest:
        figures["readline loop, pyserial on a pseudo-terminal"] = slowest
    for name, per_s in figures.items():
        print(f"| {name} | {millions(per_s)} | {f'{per_s / slowest:.0f} x' if slowest else ''} |")
    print()


def report_amplifiers(counts: np.ndarray) -> None:
    print("| amplifiers | frames/s | 2 % damaged | against a struct loop |")
    print("|---|---|---|---|")
    two = FrameLayout(2)
    plain = encode_gsv(two, counts[:PLAIN_SAMPLES]).tobytes()
    loop = PLAIN_SAMPLES / best_s(lambda: gsv_loop(plain))
    for layout in (two, FrameLayout(8), FrameLayout(2, ValueKind.INT24)):
        name = f"GSV, {layout.channels} channels, {layout.kind.name.lower()}"
        wire = encode_gsv(layout, counts).tobytes()
        report_frames(name, lambda layout=layout: GsvDecoder(layout, RATE_HZ), wire, loop)
    print(f"| GSV, 2 channels, float32, struct loop | {millions(loop)} | | 1 |")
    for model, layout in GSV_FORMATS.items():
        wire = encode_gsv_234(layout, counts >> 8).tobytes()
        report_frames(model.upper(), lambda layout=layout: Gsv234Decoder(layout, RATE_HZ), wire, loop)
    for kind in HbmFormat:
        wire = b"".join(encode_hbm(kind, counts))
        report_frames(f"HBM AED, {kind}", lambda kind=kind: HbmDecoder(kind, RATE_HZ), wire, loop)
    wire = encode_events(np.arange(SAMPLES) / 1000.0, counts >> 8).tobytes()
    report_frames("Harp LoadCells", lambda: EventDecoder(1000.0), wire, loop)
    wire = encode_scans(WITH_DIGITAL, counts >> 8).tobytes()
    report_frames(
        "DATAQ, 2 gauges and digital inputs", lambda: ScanDecoder(WITH_DIGITAL, RATE_HZ), wire, loop
    )
    poll = plan_poll(tuple(read_map("generic", {}).channels.values()))
    wire = modbus_wire(poll, counts[:PLAIN_SAMPLES])
    report_frames(
        "Modbus RTU, int32", lambda: ResponseDecoder(poll, (0, 1), 1000.0), wire, loop, PLAIN_SAMPLES
    )
    wire = pair_wire(counts[:PLAIN_SAMPLES])
    report_frames("two devices of CSV lines", PairDecoding, wire, loop, PLAIN_SAMPLES)
    print()


class PairDecoding:
    """Two devices of one value a line at 1 kHz, as if a run were decoded again."""

    def __init__(self) -> None:
        rates = {f"{gauge}.rate_hz": "1000.0" for gauge in ("table", "relative")}
        self._source = make_pair(find_driver("csv"), {}, None, rates)

    def feed(self, data: bytes, arrival_ns: int) -> Iterator[SampleBlock]:
        """Rows of both devices that `data` completes."""
        return self._source.decode(data, arrival_ns)


def pair_wire(counts: np.ndarray) -> bytes:
    """Reads of twenty lines each from both devices in turn, in their envelopes."""
    wire = []
    for first in range(0, len(counts), READ_LINES):
        arrival_ns = 5 * 10**12 + (first + READ_LINES) * 10**6
        for gauge in (0, 1):
            values = counts[first : first + READ_LINES, gauge].tolist()
            lines = "".join(f"{1000 * (first + k)},{value}\r\n" for k, value in enumerate(values))
            wire.append(wrap(gauge, arrival_ns, lines.encode()))
    return b"".join(wire)


def report_frames(
    name: str,
    decoder: "Callable[[], Decoder | PairDecoding]",
    wire: bytes,
    loop: float,
    samples: int = SAMPLES,
) -> None:
    whole, damaged = (
        samples / best_s(lambda data=data: sum(map(len, decoder().feed(data, 0))))
        for data in (wire, with_damage(wire, len(wire) // samples))
    )
    print(f"| {name} | {millions(whole)} | {millions(damaged)} | {whole / loop:.2g} x |")


def modbus_wire(poll: Poll, counts: np.ndarray) -> bytes:
    """Answers to a poll a millisecond, each in its envelope."""
    (request,) = poll.requests
    return b"".join(
        wrap_response(0, 10**6 * k, encode_read_response(request.unit, request.function, row.tobytes()))
        for k, row in enumerate(counts.astype(">i4"))
    )


def report_small_reads(counts: np.ndarray) -> None:
    print("| reads of 50 bytes, as a live port gives them | us a read |")
    print("|---|---|")
    few = counts[:PLAIN_SAMPLES]
    wire = encode_frames(0, np.arange(len(few) // 2) * 1000, few).tobytes()
    lines = b"".join(encode_lines(PLAIN, np.arange(len(few)) / RATE_HZ, few))
    for name, decoder, data in (
        ("Slipstand binary, n = 2", FrameDecoder(RATE_HZ), wire),
        ("CSV lines", LineDecoder(PLAIN, RATE_HZ), lines),
    ):
        reads = [data[at : at + 50] for at in range(0, len(data), 50)]
        per_read_s = best_s(lambda decoder=decoder, reads=reads: feed_all(decoder, reads)) / len(reads)
        print(f"| {name} | {per_read_s * 1e6:.1f} |")


def feed_all(decoder: FrameDecoder | LineDecoder, reads: list[bytes]) -> int:
    decoder.expect_restart()
    return sum(len(block) for read in reads for block in decoder.feed(read, 0))


def lines_per_s(layout: LineFormat, data: bytes) -> float:
    return SAMPLES / best_s(lambda: decode_lines(layout, data))


def best_s(work: Callable[[], int]) -> float:
    """Shortest processor time of some runs."""
    times_s = []
    for _ in range(REPEATS):
        begin_s = time.process_time()
        work()
        times_s.append(time.process_time() - begin_s)
    return min(times_s)


def millions(per_s: float) -> str:
    return f"{per_s / 1e6:.3g} M"


def with_damage(wire: bytes, length: int) -> bytes:
    """About 2 % of the units of `length` bytes with one wrong byte."""
    damaged = np.frombuffer(wire, dtype=np.uint8).copy()
    random = np.random.default_rng(2)
    damaged[random.integers(0, len(damaged), len(damaged) // length // 50)] ^= 0x04
    return damaged.tobytes()


def decode_frames(wire: bytes) -> int:
    return sum(len(block) for block in FrameDecoder(RATE_HZ).feed(wire, 0))


def decode_lines(layout: LineFormat, data: bytes) -> int:
    return sum(len(block) for block in LineDecoder(layout, RATE_HZ).feed(b"\n" + data, 0))


def struct_loop(wire: bytes) -> int:
    """A frame at a time with the standard library: sync, CRC, sequence, samples."""
    rows: list[tuple[int, ...]] = []
    at = 0
    expected = 0
    while at + 23 <= len(wire):
        if wire[at] != 0xAA or wire[at + 1] != 0x55:
            at += 1
            continue
        _, _, seq, _, n = struct.unpack_from("<BBIIB", wire, at + 2)
        end = at + 15 + 8 * n
        if binascii.crc_hqx(wire[at + 2 : end - 2], 0xFFFF) != struct.unpack_from("<H", wire, end - 2)[0]:
            at += 1
            continue
        rows.extend([(0, 0)] * (seq - expected))
        rows.extend(struct.iter_unpack("<ii", wire[at + 13 : end - 2]))
        expected = seq + n
        at = end
    return len(np.array(rows))


def gsv_loop(wire: bytes) -> int:
    """A GSV frame at a time with the standard library."""
    rows: list[tuple[float, float]] = []
    at = 0
    while at + 12 < len(wire):
        if wire[at : at + 3] != b"\xaa\x11\xb0" or wire[at + 11] != 0x85 or wire[at + 12] != 0xAA:
            at += 1
            continue
        rows.append(struct.unpack_from(">ff", wire, at + 3))
        at += 12
    return len(np.array(rows))


def readline_loop(stream: io.BytesIO) -> int:
    """A line at a time, as most programs do it."""
    rows = []
    while line := stream.readline():
        time_us, table, relative = line.split(b",")
        rows.append((int(time_us), int(table), int(relative)))
    return len(np.array(rows))


def port_lines_per_s(data: bytes) -> float:
    """Lines a second of processor time with `readline()` for each, on a pseudo-terminal fed by a child."""
    master, slave = os.openpty()
    with serial.Serial(os.ttyname(slave), 460800, timeout=1) as port:
        os.close(slave)
        wire = data.splitlines(keepends=True)[:PORT_LINES]
        with subprocess.Popen([sys.executable, "-c", FEEDER], stdin=subprocess.PIPE, stdout=master) as feeder:
            feeder.stdin.write(b"".join(wire))
            feeder.stdin.close()
            port.readline()
            begin_s = time.process_time()
            for _ in wire[1:]:
                time_us, table, relative = port.readline().split(b",")
                _ = (int(time_us), int(table), int(relative))
            elapsed_s = time.process_time() - begin_s
    os.close(master)
    return len(wire) / elapsed_s


if __name__ == "__main__":
    for layout in (PLAIN, CHECKED):  # compiled code is loaded
        list(LineDecoder(layout, 1.0).feed(b"\n" + encode_line(layout, 0.0, 0, 0), 0))
    sys.exit(main())
