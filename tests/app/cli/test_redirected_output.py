"""What is written to files and pipes is UTF-8, whatever the code page of the system."""

import io
import re
import sys

import pytest

from app import cli
from app.cli import output

GREEK = "f_d = 0.1, ζ = 1 µ"


class Terminal(io.BytesIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("raw", "chosen", "encoding"),
    [(io.BytesIO(), "", "utf-8"), (Terminal(), "", "cp1252"), (io.BytesIO(), "cp1252", "cp1252")],
)
def test_only_terminals_and_who_chose_it_get_another_encoding(
    raw: io.BytesIO, chosen: str, encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", chosen)
    for name in ("stdout", "stderr"):
        monkeypatch.setattr(sys, name, io.TextIOWrapper(raw, encoding="cp1252", newline=""))
    monkeypatch.setattr(cli, "app", lambda **_: sys.stdout.write(f"{GREEK} \udcff\n"))
    cli.run()
    sys.stdout.flush()
    assert raw.getvalue() == f"{GREEK} \udcff\n".encode(encoding, "backslashreplace")


@pytest.mark.parametrize(
    ("environment", "shown"),
    [
        ({"LC_ALL": "C"}, "0.1 +- 0.2 um"),
        ({"LC_ALL": "", "LC_CTYPE": "", "LANG": "POSIX"}, "0.1 +- 0.2 um"),
        ({"LC_ALL": "", "LC_CTYPE": "C.UTF-8", "LANG": "C"}, "0.1 ± 0.2 µm"),
        ({"LC_ALL": "", "LC_CTYPE": "", "LANG": ""}, "0.1 ± 0.2 µm"),
    ],
)
def test_a_terminal_of_an_ascii_locale_is_shown_ascii(
    environment: dict[str, str], shown: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    raw = Terminal()
    monkeypatch.setenv("PYTHONIOENCODING", "")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    stdout, stderr = (io.TextIOWrapper(one, encoding="utf-8", newline="") for one in (raw, Terminal()))
    monkeypatch.setattr(sys, "stdout", stdout)
    monkeypatch.setattr(sys, "stderr", stderr)
    monkeypatch.setattr(cli, "app", lambda **_: sys.stdout.write("0.1 ± 0.2 µm"))
    cli.run()
    stdout.flush()
    assert raw.getvalue() == shown.encode()


def test_the_progress_bar_is_kept_without_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = Terminal()
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    stream = io.TextIOWrapper(raw, encoding="utf-8", newline="")
    monkeypatch.setattr(sys, "stderr", stream)
    with output.progress_bar("looking at new files", total=1.0) as update:
        update(0.5)
    stream.flush()
    shown = raw.getvalue().decode()
    assert "━━━━" in shown or (sys.platform == "win32" and "----" in shown)  # its console may lack the former
    assert re.findall("\x1b\\[[0-9;]*m", shown) == []
