import os
import queue
import socket
import sys
import threading
import time

import pytest

from drivers.errors import DeviceLostError, PortUnavailableError, QueueFullError, SettingsError
from drivers.host_time import host_ns
from drivers.port import (
    Port,
    PortConfig,
    PortInfo,
    PortUser,
    device_lost_error,
    device_path,
    find_replugged,
    list_ports,
    open_port,
    port_info,
    port_unavailable_error,
)
from drivers.source import LineSettings
from drivers.stream import PortReader, ReaderEndReason
from tests.waiting import PATIENCE_S

posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX")


def read_until(port, size: int) -> bytes:
    end_s = time.perf_counter() + PATIENCE_S
    data = b""
    while len(data) < size and time.perf_counter() < end_s:
        data += port.read()
    return data


def write_on(port) -> None:
    for _ in range(200):
        port.write(b"S" * 10_000)
        time.sleep(0.001)


@pytest.fixture
def server():
    listening = socket.create_server(("127.0.0.1", 0))
    listening.settimeout(PATIENCE_S)
    yield listening
    listening.close()


@pytest.fixture
def socket_pair(server):
    """A port on socket://, and the other end of it."""
    with open_port(f"socket://127.0.0.1:{server.getsockname()[1]}", 115200) as port:
        other, _ = server.accept()
        with other:
            yield port, other


@pytest.fixture
def terminal():
    """Path of a pseudo-terminal, and the descriptor of its other end."""
    master, slave = os.openpty()
    path = os.ttyname(slave)
    os.close(slave)
    ends = [master]
    yield path, ends
    for end in ends:
        os.close(end)


# --- reading and writing ---------------------------------------------------------------------


def test_a_loop_brings_back_what_was_sent():
    with open_port("loop://", 115200) as port:
        port.write(b"\x00\xff\r\n" * 500)
        assert read_until(port, 2000) == b"\x00\xff\r\n" * 500
        assert port.read() == b""


def test_a_socket_both_ways(socket_pair):
    port, other = socket_pair
    port.write(b"I")
    assert other.recv(10) == b"I"
    data = os.urandom(20_000)
    threading.Thread(target=other.sendall, args=(data,)).start()
    assert read_until(port, len(data)) == data


def test_a_read_with_nothing_there_returns_soon(socket_pair):
    port, _ = socket_pair
    assert port.read() == b""  # a stuck read would wait for ever


def test_a_socket_that_ends_gives_its_last_bytes_first(socket_pair):
    port, other = socket_pair
    other.sendall(b"last words")
    other.close()
    assert read_until(port, 10) == b"last words"
    with pytest.raises(DeviceLostError, match=r"socket://.* was closed by the other end: check its power"):
        read_until(port, 1)


def test_writing_to_a_socket_that_is_gone(socket_pair):
    port, other = socket_pair
    other.close()
    with pytest.raises(DeviceLostError):
        write_on(port)


@posix
def test_a_port_is_tuned_while_it_is_open(terminal):
    path, (master,) = terminal
    with open_port(path, 9600) as port:
        assert not port.has_baud
        os.write(master, b"old")
        time.sleep(0.05)
        port.configure(LineSettings(230400))
        os.write(master, b"new")
        assert read_until(port, 3) == b"new"
        with pytest.raises(SettingsError, match=r"cannot be set to -1 baud, parity N .*: give others"):
            port.configure(LineSettings(-1))
    with open_port("loop://", 9600) as port:
        assert not port.has_baud


@posix
def test_a_pseudo_terminal_at_the_usual_rates(terminal):
    path, (master,) = terminal
    for baud in (9600, 115200, 230400, 460800, 250_000):
        with open_port(path, baud) as port:
            os.write(master, bytes(range(256)))
            assert read_until(port, 256) == bytes(range(256))
            port.write(b"R500\n")
            assert os.read(master, 100) == b"R500\n"


@posix
def test_a_terminal_that_is_unplugged(terminal):
    path, ends = terminal
    with open_port(path, 115200) as port:
        os.close(ends.pop())
        with pytest.raises(DeviceLostError):
            read_until(port, 1)
        with pytest.raises(DeviceLostError):
            port.write(b"S")


def test_closing_twice_is_nothing_special():
    port = open_port("loop://", 9600)
    port.close()
    port.close()


# --- what cannot be opened ---------------------------------------------------------------------


@posix
def test_a_port_that_is_not_there():
    with pytest.raises(PortUnavailableError, match="no port /dev/ttyUSB77: plug the device in") as error:
        open_port("/dev/ttyUSB77", 115200)
    assert "\n" not in str(error.value)


def test_a_port_that_another_program_reads_is_not_opened_though_it_takes_no_lock(monkeypatch):
    monkeypatch.setattr("drivers.port.other_port_users", lambda _: [PortUser(812, "ModemManager")])
    with pytest.raises(PortUnavailableError) as error:
        open_port("/dev/ttyACM0", 115200)
    assert str(error.value) == (
        "port /dev/ttyACM0 is busy, held by ModemManager (process 812): close the program that has it open"
    )


@posix
def test_a_busy_port_names_its_holder(terminal):
    path, _ = terminal
    holder = rf", held by .*\(process {os.getpid()}\)" if sys.platform == "linux" else ""
    with (
        open_port(path, 115200),
        pytest.raises(PortUnavailableError, match=rf"{path} is busy{holder}: close"),
    ):
        open_port(path, 115200)
    open_port(path, 115200).close()


@posix
def test_a_file_is_no_port(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(PortUnavailableError, match="cannot be used as a serial port"):
        open_port(str(tmp_path / "file"), 115200)


def test_a_socket_where_nobody_listens(server):
    port_number = server.getsockname()[1]
    server.close()
    with pytest.raises(PortUnavailableError, match="refuses: nothing listens there, start"):
        open_port(f"socket://127.0.0.1:{port_number}", 115200)


def test_a_kind_of_url_that_nobody_knows():
    with pytest.raises(PortUnavailableError, match="no kind of port that is known"):
        open_port("carrier-pigeon://loft", 115200)


@posix
def test_stop_bits_reach_the_port(terminal):
    """SCMBus of Scaime is 8N2 (eNod4 software manual). A pseudo-terminal keeps them, not parity."""
    import termios

    path, (master,) = terminal
    for config, flags in (
        (PortConfig(path, 9600, "N", 2), termios.CSTOPB),
        (PortConfig(path, 9600), 0),
    ):
        with config.open() as port:
            assert termios.tcgetattr(master)[2] & termios.CSTOPB == flags
            port.configure(LineSettings(9600, "N", 2))
            assert termios.tcgetattr(master)[2] & termios.CSTOPB
    assert str(LineSettings(9600, "E", 2)) == "9600 baud 8E2"


def test_settings_that_no_port_has():
    with pytest.raises(SettingsError, match="stop_bits 3 are not known: give one of 1, 2"):
        open_port("loop://", 9600, stop_bits=3)
    with pytest.raises(SettingsError, match="parity 'X' is not known: give one of N, E, O"):
        open_port("loop://", 9600, parity="X")
    with pytest.raises(SettingsError, match="baud 0 is not possible"):
        open_port("loop://", 0)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        # As pyserial words them on POSIX (with errno) and on Windows (text alone).
        (OSError(13, "could not open port /dev/x: [Errno 13] Permission denied"), "usermod -aG dialout"),
        (OSError(16, "Device or resource busy"), "is busy"),
        (OSError("could not open port 'COM3': PermissionError(13, 'Access is denied.', None, 5)"), "is busy"),
        (
            OSError("could not open port 'COM9': FileNotFoundError(2, 'The system cannot find', None, 2)"),
            "there is no port /dev/x: plug the device in or give its name; ports here: COM1, COM2",
        ),
        (ValueError("Invalid baud rate: 17"), "cannot be set to 17 baud"),
        (OSError("Could not configure port: (5, 'Input/output error')"), "cannot be used as a serial port"),
    ],
)
def test_errors_of_all_systems_become_one_line_with_a_remedy(error, said):
    message = str(port_unavailable_error("/dev/x", 17, error, ["COM1", "COM2"]))
    assert said in message
    assert "\n" not in message


# --- the reader thread ------------------------------------------------------------------------


class Ending:
    """Waits for the last word of a reader."""

    def __init__(self) -> None:
        self._words: queue.Queue = queue.Queue()

    def __call__(self, ended) -> None:
        self._words.put(ended)

    def wait(self):
        ended = self._words.get(timeout=PATIENCE_S)
        assert self._words.empty()
        return ended


def test_the_reader_hands_on_everything_in_order_and_stops(socket_pair):
    port, other = socket_pair
    reads: list[tuple[int, bytes]] = []
    ending = Ending()
    reader = PortReader(port.read, lambda arrival_ns, data: reads.append((arrival_ns, data)), ending)
    begin_ns = host_ns()
    reader.start()
    data = os.urandom(50_000)
    other.sendall(data)
    while sum(len(read) for _, read in reads) < len(data):
        time.sleep(0.005)
    reader.stop()
    assert ending.wait().reason is ReaderEndReason.STOPPED
    assert b"".join(read for _, read in reads) == data
    arrivals_ns = [arrival_ns for arrival_ns, _ in reads]
    assert begin_ns < arrivals_ns[0]
    assert arrivals_ns == sorted(arrivals_ns)
    assert arrivals_ns[-1] < host_ns()


def test_the_reader_tells_that_the_device_is_lost(socket_pair):
    port, other = socket_pair
    ending = Ending()
    reader = PortReader(port.read, lambda *_: None, ending)
    reader.start()
    other.close()
    ended = ending.wait()
    assert ended.reason is ReaderEndReason.DEVICE_LOST
    assert "was closed by the other end" in str(ended.message)
    reader.stop()


def test_a_full_queue_ends_the_reader_and_nothing_is_skipped(socket_pair):
    port, other = socket_pair
    taken: list[bytes] = []

    def sink(arrival_ns: int, data: bytes) -> None:
        if taken:
            raise QueueFullError("the journal is 4 MB behind")
        taken.append(data)

    ending = Ending()
    reader = PortReader(port.read, sink, ending)
    reader.start()
    other.sendall(b"first")
    while not taken:
        time.sleep(0.005)
    other.sendall(b"second")
    ended = ending.wait()
    assert (ended.reason, str(ended.message)) == (ReaderEndReason.QUEUE_FULL, "the journal is 4 MB behind")
    reader.stop()
    assert taken == [b"first"]


def test_a_sink_that_fails_is_not_a_quiet_end(socket_pair):
    port, other = socket_pair

    def sink(arrival_ns: int, data: bytes) -> None:
        raise ZeroDivisionError("oops")

    ending = Ending()
    reader = PortReader(port.read, sink, ending)
    reader.start()
    other.sendall(b"x")
    ended = ending.wait()
    assert ended.reason is ReaderEndReason.FAILED
    assert "ZeroDivisionError: oops" in str(ended.message)
    reader.stop()


def test_what_came_in_pieces_before_a_port_vanished_is_not_lost():
    class VanishingWire:
        """A port of Windows: what waits is asked for again and again, until ClearCommError fails."""

        pieces = [b"ab", b"cd", b"ef"]  # noqa: RUF012

        @property
        def in_waiting(self):
            if not self.pieces:
                raise OSError("ClearCommError failed (PermissionError(13, 'Access is denied.', None, 5))")
            return len(self.pieces[0])

        def read(self, _size):
            return self.pieces.pop(0)

    port = Port(VanishingWire(), "COM3")
    assert port.read() == b"abcdef"
    with pytest.raises(DeviceLostError, match="COM3 is gone"):
        port.read()


# --- what is there -----------------------------------------------------------------------------


def test_ports_are_listed_with_their_identity(monkeypatch):
    class Entry:
        device, description, vid, pid, serial_number, location = "COM7", None, 0x0403, 0x6001, None, "1-2"

    class Earlier(Entry):
        device, description, serial_number = "COM3", "USB Serial", "A50285BI"

    monkeypatch.setattr("drivers.port.serial_list_ports.comports", lambda: [Entry, Earlier])
    assert list_ports() == [
        PortInfo("COM3", "USB Serial", 0x0403, 0x6001, "A50285BI", "1-2"),
        PortInfo("COM7", "", 0x0403, 0x6001, "", "1-2"),
    ]


def test_a_device_that_vanishes_while_windows_lists_it_fails_nobody_who_looks_for_it(monkeypatch):
    def vanished():
        raise OSError(22, "A device which does not exist was specified", None, 433)

    monkeypatch.setattr("drivers.port.serial_list_ports.comports", vanished)
    assert list_ports() == []
    assert find_replugged(PortInfo("COM3", "", 0x2341, 0x0043, "7")) is None
    assert port_info("COM3") == PortInfo("COM3")


def test_a_device_is_known_again_by_its_numbers():
    before = PortInfo("/dev/ttyUSB0", "a", 0x0403, 0x6001, "A1")
    assert before.is_same_device(PortInfo("/dev/ttyUSB3", "b", 0x0403, 0x6001, "A1"))
    assert not before.is_same_device(PortInfo("/dev/ttyUSB0", "a", 0x0403, 0x6001, "A2"))
    assert not PortInfo("/dev/ttyS0").is_same_device(PortInfo("/dev/ttyS1"))


LOST = PortInfo("/dev/ttyUSB0", "bridge", 0x1A86, 0x7523, "", "1-2")


@pytest.mark.parametrize(
    ("lost", "there", "found"),
    [
        (PortInfo("socket://10.0.0.7:4000"), [], "socket://10.0.0.7:4000"),
        (PortInfo("/dev/serial/by-id/amplifier"), [LOST], "/dev/serial/by-id/amplifier"),
        (PortInfo("COM3", "", 1, 2, "A1"), [PortInfo("COM9", "", 1, 2, "A1", "3-1")], "COM9"),
        (PortInfo("COM3", "", 1, 2, "A1"), [PortInfo("COM3", "", 1, 2, "A2")], None),
        (LOST, [], None),
        (LOST, [PortInfo("/dev/ttyUSB4", "bridge", 0x1A86, 0x7523, "", "1-2")], "/dev/ttyUSB4"),
        (LOST, [PortInfo("/dev/ttyUSB0", "bridge", 0x1A86, 0x7523, "", "2-1")], "/dev/ttyUSB0"),
        (LOST, [PortInfo("/dev/ttyUSB4", "bridge", 0x1A86, 0x7523, "", "2-1")], None),
        (
            LOST,
            [
                PortInfo("/dev/ttyUSB0", "another", 0x1A86, 0x7523, "", "2-1"),
                PortInfo("/dev/ttyUSB1", "bridge", 0x1A86, 0x7523, "", "1-2"),
            ],
            "/dev/ttyUSB1",
        ),
    ],
)
def test_a_lost_device_is_found_again_by_its_identity(monkeypatch, lost, there, found):
    monkeypatch.setattr("drivers.port.list_ports", lambda: there)
    assert find_replugged(lost) == found


@pytest.mark.parametrize(
    ("url", "error", "said"),
    [
        ("/dev/x", OSError(5, "Input/output error"), "port /dev/x is gone: plug its cable in again"),
        ("COM3", OSError("ClearCommError failed (PermissionError(13, ...))"), "port COM3 is gone: plug"),
        ("/dev/x", OSError("Write timeout"), "takes nothing of what is sent: check the device"),
        ("socket://a:1", OSError("socket disconnected"), "closed by the other end: check its power"),
    ],
)
def test_a_loss_is_told_in_words_with_a_remedy(url, error, said):
    assert said in str(device_lost_error(url, error))


def test_a_port_tells_what_it_is():
    with open_port("loop://", 9600) as port:
        assert port.info == PortInfo("loop://")


# --- names of other systems ------------------------------------------------------------------


@pytest.mark.parametrize("name", ["COM3", "com12", r"\\.\COM12", "//./COM256"])
def test_a_port_of_windows_is_known_by_the_name_that_the_system_lists(name, monkeypatch):
    def refuse(path):
        raise AssertionError(f"{path} was opened")

    monkeypatch.setattr(os.path, "realpath", refuse)
    listed = PortInfo(device_path(name), "FT232R", 0x0403, 0x6001, "A1")
    assert listed.device in ("COM3", "COM12", "COM256")
    monkeypatch.setattr("drivers.port.list_ports", lambda: [listed])
    assert port_info(name) is listed


@posix
def test_a_port_of_macos_is_known_by_either_of_its_names(monkeypatch):
    listed = PortInfo("/dev/cu.usbserial-A1", "FT232R", 0x0403, 0x6001, "A1")
    monkeypatch.setattr("drivers.port.list_ports", lambda: [listed])
    assert port_info("/dev/tty.usbserial-A1") is port_info("/dev/cu.usbserial-A1") is listed


def test_ports_are_listed_by_number(monkeypatch):
    class Listed:
        def __init__(self, device: str) -> None:
            self.device, self.description, self.vid, self.pid = device, "", None, None
            self.serial_number = self.location = ""

    names = ["COM10", "COM9", "COM1", "/dev/ttyUSB11", "/dev/ttyUSB2", "/dev/ttyACM0"]
    monkeypatch.setattr("drivers.port.serial_list_ports.comports", lambda: map(Listed, names))
    assert [port.device for port in list_ports()] == [
        "/dev/ttyACM0", "/dev/ttyUSB2", "/dev/ttyUSB11", "COM1", "COM9", "COM10",
    ]  # fmt: skip
