"""Hints, from folders that look like those of Linux."""

import os
import sys
from pathlib import Path

import pytest

from drivers import host_checks
from drivers.host_checks import latency_ms, modem_manager_runs, port_hints, usb_chip_name
from drivers.port import PortInfo, PortUser, other_port_users, port_users

posix = pytest.mark.skipif(sys.platform == "win32", reason="rights and folders of POSIX")
ADAPTER = PortInfo("/dev/ttyUSB7", "USB serial", 0x0403, 0x6001, "A50285BI")


def process(folder: Path, number: int, name: str, *files: str) -> None:
    (folder / str(number) / "fd").mkdir(parents=True)
    (folder / str(number) / "comm").write_text(f"{name}\n")
    for place, file in enumerate(files):
        (folder / str(number) / "fd" / str(place)).symlink_to(file)


@posix
def test_programs_that_have_a_port_open(tmp_path):
    port = tmp_path / "ttyACM0"
    port.touch()
    (tmp_path / "by-id").symlink_to(port)
    process(tmp_path / "proc", 41, "minicom", "/dev/null", str(port))
    process(tmp_path / "proc", 42, "bash", "/dev/null")
    (tmp_path / "proc" / "43").mkdir()  # of another user: nothing is to be seen
    (tmp_path / "proc" / "self").mkdir()
    for name in (port, tmp_path / "by-id"):
        (holder,) = port_users(str(name), tmp_path / "proc")
        assert holder == PortUser(41, "minicom")
        assert str(holder) == "minicom (process 41)"
    assert port_users(str(port), tmp_path / "nowhere") == []
    assert port_users("socket://localhost:1", tmp_path / "proc") == []
    assert str(PortUser(5, "")) == "process 5"


@posix
def test_this_program_and_pseudo_terminals_do_not_count(tmp_path):
    process(tmp_path, 41, "minicom", "/dev/ttyACM55", "/dev/pts/9")
    process(tmp_path, os.getpid(), "slipstand", "/dev/ttyACM55")
    assert other_port_users("/dev/ttyACM55", tmp_path) == [PortUser(41, "minicom")]
    assert other_port_users("/dev/pts/9", tmp_path) == []
    assert other_port_users("COM3", tmp_path) == []


def folders(tmp_path: Path, held_ms: int | None = None, *programs: str) -> dict[str, Path]:
    for number, name in enumerate(programs):
        process(tmp_path / "proc", 50 + number, name)
    if held_ms is not None:
        (tmp_path / "usb" / "ttyUSB7").mkdir(parents=True)
        (tmp_path / "usb" / "ttyUSB7" / "latency_timer").write_text(f"{held_ms}\n")
    return {"processes": tmp_path / "proc", "usb_serial": tmp_path / "usb", "udev_data": tmp_path / "udev"}


@posix
def test_nothing_stands_in_the_way(tmp_path):
    assert list(port_hints(ADAPTER, **folders(tmp_path, 1, "bash"))) == []
    assert (
        list(port_hints(PortInfo("socket://box:5000"), **folders(tmp_path / "b", None, "ModemManager"))) == []
    )


@posix
def test_an_adapter_that_holds_bytes_back(tmp_path):
    (hint,) = port_hints(ADAPTER, **folders(tmp_path, 16))
    assert str(hint.message).startswith("the FTDI adapter of /dev/ttyUSB7 holds bytes back for 16 ms")
    assert hint.rule_helps


@posix
def test_modem_manager_and_the_rule_that_keeps_it_away(tmp_path, monkeypatch):
    places = folders(tmp_path, 1, "ModemManager")
    (hint,) = port_hints(ADAPTER, **places)
    assert (
        str(hint.message)
        == "ModemManager runs and talks to /dev/ttyUSB7 for some seconds after it is plugged in"
    )
    assert modem_manager_runs(places["processes"])
    ignored = PortInfo("/dev/null", "", 0x2341, 0x43)
    number = Path("/dev/null").stat().st_rdev
    places["udev_data"].mkdir()
    known = places["udev_data"] / f"c{os.major(number)}:{os.minor(number)}"
    known.write_text("E:ID_MM_CANDIDATE=1\n")
    assert len(list(port_hints(ignored, **places))) == 1
    known.write_text("I:5\nE:ID_MM_PORT_IGNORE=1\n")
    assert list(port_hints(ignored, **places)) == []


@posix
def test_a_port_that_this_user_may_not_open(tmp_path, monkeypatch):
    port = tmp_path / "ttyACM0"
    port.touch()
    monkeypatch.setattr(os, "access", lambda *_: False)
    monkeypatch.setattr(Path, "group", lambda _: "uucp")
    (hint,) = port_hints(PortInfo(str(port)), **folders(tmp_path))
    assert str(hint.message) == f"{port} may not be opened by this user (group uucp may)"
    assert str(hint.remedy) == "Run: sudo usermod -aG uucp $USER, then log in again"


def test_a_system_without_those_folders(tmp_path):
    nowhere = tmp_path / "nowhere"
    assert not modem_manager_runs(nowhere)
    assert latency_ms(ADAPTER, nowhere) is None
    assert latency_ms(PortInfo("COM3", "", 0x1A86, 0x7523), nowhere) is None


@pytest.mark.parametrize(
    ("vendor_id", "product_id", "name"),
    [
        (0x1A86, 0x7523, "WCH CH340 adapter, as on many Arduino clones"),
        (0x0403, 0x6001, "FTDI FT232R adapter"),
        (0x2341, 0x9999, "Arduino"),
        (0x1234, 1, ""),
        (None, None, ""),
    ],
)
def test_names_of_chips(vendor_id, product_id, name):
    assert usb_chip_name(vendor_id, product_id) == name


def test_the_rule_covers_every_known_maker():

    rule = (Path(__file__).parents[2] / "config/udev/60-slipstand.rules").read_text("utf-8")
    (line,) = [line for line in rule.splitlines() if "ATTRS{idVendor}" in line]
    assert set(line.split('"')[3].split("|")) == {f"{maker:04x}" for maker in host_checks._MAKERS}
