import os
import shutil
import subprocess
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
REMOVED, LATER = "libglib2.0-0", "libglib2.0-0t64"  # its name since Debian 13 and Ubuntu 24.04

pytestmark = pytest.mark.skipif(
    not (shutil.which("make") and shutil.which("dpkg-query")), reason="asks dpkg of Debian, by make"
)


def wanted() -> list[str]:
    text = (PROJECT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    line = next(line for line in text.splitlines() if line.startswith("QT_PACKAGES :="))
    return line.partition(":=")[2].split()


def paragraph(name: str, provides: str = "", status: str = "installed") -> str:
    provided = f"Provides: libother (= 1), {provides} (= 2.84.4-3)\n" if provides else ""
    waits = {
        "triggers-pending": "Triggers-Pending: ldconfig\n",
        "triggers-awaited": "Triggers-Awaited: libc-bin\n",
    }
    provided += waits.get(status, "")
    head = f"Package: {name}\nStatus: install ok {status}\nArchitecture: amd64\nVersion: 2.84.4-3\n"
    return f"{head}{provided}Maintainer: nobody <nobody@example.org>\nDescription: a library\n\n"


def asked_for(folder: Path, paragraphs: list[str]) -> "subprocess.CompletedProcess[str]":
    """What `make system-libraries` says to a user who is not root, on a system with these packages."""
    (folder / "dpkg").mkdir()
    (folder / "dpkg" / "status").write_text("".join(paragraphs), encoding="utf-8")
    commands = folder / "bin"
    commands.mkdir()
    for name, text in (("id", "echo 1000"), ("apt-get", "exit 1")):
        (commands / name).write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        (commands / name).chmod(0o755)
    variables = {"DPKG_ADMINDIR": str(folder / "dpkg"), "PATH": f"{commands}:{os.environ['PATH']}"}
    command = ["make", "--no-print-directory", "-C", str(PROJECT), "system-libraries"]
    return subprocess.run(
        command, env=os.environ | variables, check=False, capture_output=True, text=True, timeout=60
    )


def test_a_library_under_its_later_name_is_not_missing(tmp_path: Path) -> None:
    assert REMOVED in wanted()
    there = [paragraph(name) for name in wanted() if name != REMOVED]

    ended = asked_for(tmp_path, [*there, paragraph(LATER, provides=REMOVED)])

    assert (ended.returncode, ended.stdout + ended.stderr) == (0, "")


@pytest.mark.parametrize("status", ["triggers-pending", "triggers-awaited"])
def test_a_library_is_there_while_another_is_installed(tmp_path: Path, status: str) -> None:
    there = [paragraph(name, status=status if name == REMOVED else "installed") for name in wanted()]

    ended = asked_for(tmp_path, there)

    assert (ended.returncode, ended.stdout + ended.stderr) == (0, "")


def test_a_library_that_was_removed_is_asked_for(tmp_path: Path) -> None:
    there = [paragraph(name) for name in wanted() if name != REMOVED]

    ended = asked_for(tmp_path, [*there, paragraph(REMOVED, status="config-files")])

    assert ended.returncode != 0
    assert f"sudo apt-get install -y {REMOVED} " in ended.stdout + ended.stderr
