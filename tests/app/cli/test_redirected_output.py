"""What is written to files and pipes is UTF-8, whatever the code page of the system."""

import io
import sys

import pytest

from app import cli

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
    monkeypatch.setattr(cli, "app", lambda: sys.stdout.write(f"{GREEK} \udcff\n"))
    cli.run()
    sys.stdout.flush()
    assert raw.getvalue() == f"{GREEK} \udcff\n".encode(encoding, "backslashreplace")
