"""The simulated device's TCP port: one reader at a time, who may reconnect."""

import socket
import time

import pytest

from drivers.errors import PortUnavailableError
from drivers.port import open_port
from drivers.simulated.transport import open_tcp_port
from tests.waiting import PATIENCE_S


@pytest.fixture
def port():
    port = open_tcp_port()
    yield port
    port.close()


def address(port) -> tuple[str, int]:
    host, _, number = port.url.removeprefix("socket://").partition(":")
    return host, int(number)


def connect(port) -> socket.socket:
    return socket.create_connection(address(port), timeout=PATIENCE_S)


def until(port, expected):
    """Receive until something else than before comes."""
    end = time.perf_counter() + PATIENCE_S
    while (received := port.receive()) != expected and time.perf_counter() < end:
        port.wait(0.01)
    assert received == expected


def test_it_listens_on_this_computer_only(port):
    assert address(port)[0] == "127.0.0.1"
    assert port.receive() is None


def test_bytes_pass_unchanged_both_ways(port):
    every_byte = bytes(range(256))
    with connect(port) as reader:
        until(port, b"")
        assert port.send(every_byte) == 256
        assert reader.recv(256, socket.MSG_WAITALL) == every_byte
        reader.sendall(every_byte)
        until(port, every_byte)


def test_a_reader_may_go_and_come_back(port):
    for _ in range(3):
        with connect(port) as reader:
            until(port, b"")
            port.send(b"hello")
            assert reader.recv(5, socket.MSG_WAITALL) == b"hello"
        until(port, None)
        assert port.send(b"nobody hears this") == 0


def test_a_second_reader_is_refused_while_the_first_one_is_there(port):
    with connect(port) as reader:
        until(port, b"")
        with pytest.raises(ConnectionRefusedError):
            connect(port)
        with pytest.raises(PortUnavailableError, match="socket://"):
            open_port(port.url, 115200)
        port.send(b"still here")
        assert reader.recv(10, socket.MSG_WAITALL) == b"still here"
    until(port, None)
    with connect(port):
        until(port, b"")


def test_unplugged_it_ends_the_connection_and_refuses_until_it_is_back(port):
    with connect(port) as reader:
        until(port, b"")
        port.unplug()
        assert reader.recv(1) == b""
        assert port.receive() is None
        assert port.send(b"x") == 0
        port.wait(0.001)
        with pytest.raises(ConnectionRefusedError):
            connect(port)
    port.plug_in()
    with connect(port):
        until(port, b"")


def test_what_the_reader_does_not_fetch_is_not_taken_and_nobody_waits(port):
    with connect(port):
        until(port, b"")
        taken = [port.send(bytes(65536)) for _ in range(400)]
        assert taken[-1] == 0
        assert 0 < sum(taken) < 400 * 65536


def test_a_port_in_use_is_refused_with_a_remedy(port):
    with pytest.raises(PortUnavailableError, match="another program: give another one"):
        open_tcp_port(address(port)[1])
