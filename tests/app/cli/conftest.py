"""Running the command line inside the test's own process."""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from app.__main__ import main


@dataclass(frozen=True)
class Outcome:
    """What a command said and how it ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Stdout as the one JSON document that it must be."""
        return json.loads(self.out)


Slipstand = Callable[..., Outcome]


@pytest.fixture
def slipstand(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Slipstand:
    """Run `slipstand ARGUMENTS` and return how it ended."""

    def run(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["slipstand", *map(str, arguments)])
        capsys.readouterr()
        code: object = 0
        try:
            main()
        except SystemExit as ending:
            code = ending.code or 0
        said = capsys.readouterr()
        return Outcome(int(str(code)), said.out, said.err)

    return run
