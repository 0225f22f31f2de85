"""How to identify a run: the request, its identity, and the command that makes it."""

import math
import os
import shlex
from pathlib import Path
from typing import Any, Literal, Self

import msgspec

from app.runs.errors import MetadataError
from app.runs.hashes import content_hash

_ABOVE_ZERO = ("table_mass_kg", "plate_mass_kg", "added_mass_kg")
_OPTIONS = {
    "model": "--model",
    "kind": "--kind",
    "table_mass_kg": "--table-mass",
    "plate_mass_kg": "--plate-mass",
    "monte_carlo": "--monte-carlo",
    "from_s": "--from",
    "until_s": "--until",
    "release": "--release",
    "added_mass_kg": "--added-mass",
    "added_mass_uncertainty_kg": "--added-mass-uncertainty",
}
"""Options of `slipstand analyze` by field. A field that is not among them changes no result."""


class AnalysisRequest(msgspec.Struct, frozen=True):
    """How to identify a run. Masses given here stand for those of the run, in this analysis alone."""

    model: str = "auto"
    kind: Literal["two-mass", "one-mass"] = "two-mass"
    """`one-mass` takes gauge 1 alone: a bare table, or any free decay."""
    table_mass_kg: float | None = None
    plate_mass_kg: float | None = None
    monte_carlo: int | None = None
    classical: bool = True
    """Work out the paper's own figures too, which takes half a second."""
    from_s: float | None = None
    """First and last time of the record that is analysed (s); None: its first and its last."""
    until_s: float | None = None
    release: int | None = None
    """Which release of the record, from 1 in order of time; None: the one with the longest decay."""
    added_mass_kg: float | None = None
    """Mass that the table carried beside its own, with its standard uncertainty; for `one-mass`."""
    added_mass_uncertainty_kg: float = 0.0

    def __post_init__(self) -> None:
        for name in _ABOVE_ZERO:
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise MetadataError(
                    "{name} = {value:g} must be a finite number above 0", name=name, value=value
                )

    @classmethod
    def of_settings(cls, settings: dict[str, Any]) -> Self | None:
        """Request of an analysis that is kept in a run; None where another version knew more of it."""
        try:
            return msgspec.convert(settings, cls) if settings.keys() <= set(cls.__struct_fields__) else None
        except ValueError:
            return None

    @property
    def given(self) -> dict[str, Any]:
        """What is not by default, and changes results."""
        defaults = AnalysisRequest()
        values = {name: getattr(self, name) for name in _OPTIONS}
        return {name: value for name, value in values.items() if value != getattr(defaults, name)}

    @property
    def identity(self) -> str:
        """Hash of `given`: the same for requests that ask for the same, whichever version made them."""
        return content_hash(self.given)

    @property
    def key(self) -> str:
        """Hash of all fields: the same for equal requests."""
        return content_hash(msgspec.to_builtins(self))

    def command(self, run: Path) -> str:
        """Command that gives the results of this request on a run, to the last digit."""
        given = self.given.items()
        options = [word for name, value in given for word in (_OPTIONS[name], _number_text(value))]
        return quote_command(["slipstand", "analyze", str(run), *options])


def quote_command(words: list[str]) -> str:
    """Quote words as the shell of this system reads them."""
    if os.name == "nt":
        import subprocess

        return subprocess.list2cmdline(words)
    return shlex.join(words)


def _number_text(value: object) -> str:
    return repr(value) if isinstance(value, float) else str(value)
