"""Facts about the program: versions, licences, documentation, log."""

import importlib.metadata
import platform
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import config
from app.log import log_folder
from app.version import version_text
from config.files import is_checkout

PACKAGE = "slipstand"
_LONGEST_LICENCE = 60
"""Characters of the name of a licence; some packages put the whole text there."""


@dataclass(frozen=True, slots=True)
class Component:
    """The program itself, or a library that it uses."""

    name: str
    version: str
    licence: str


def components() -> tuple[Component, ...]:
    """The program, Python, and the libraries of an installation, with their licences."""
    ours = Component("Slipstand", version_text(), _licence(PACKAGE) or "MIT")
    python = Component("Python", platform.python_version(), "PSF-2.0")
    return ours, python, *_libraries()


def versions_text() -> str:
    """Versions and system in lines, to copy into a report of a fault."""
    lines = [f"{part.name} {part.version}" for part in components()]
    return "\n".join((*lines, platform.platform()))


def documentation() -> str:
    """Path of the documentation in a checkout, else the address that the package states; "" without one."""
    if is_checkout():
        return str(Path(config.__file__).resolve().parent.parent / "docs" / "README.md")
    try:
        addresses = importlib.metadata.metadata(PACKAGE).get_all("Project-URL") or []
    except importlib.metadata.PackageNotFoundError:
        return ""
    return next((address.partition(",")[2].strip() for address in addresses), "")


def log_file() -> Path:
    """Log of the window, which `start_log` writes."""
    return log_folder() / "window.log"


def _libraries() -> Iterator[Component]:
    try:
        required = importlib.metadata.requires(PACKAGE) or []
    except importlib.metadata.PackageNotFoundError:
        required = []
    names = [re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in required if "extra ==" not in line]
    for name in dict.fromkeys(names):
        try:
            yield Component(name, importlib.metadata.version(name), _licence(name))
        except importlib.metadata.PackageNotFoundError:
            continue


def _licence(name: str) -> str:
    """Licence that a package states, as an SPDX expression where it does; "" where it states none."""
    try:
        stated = importlib.metadata.metadata(name)
    except importlib.metadata.PackageNotFoundError:
        return ""
    expression, text = ((stated.get_all(key) or [""])[0] for key in ("License-Expression", "License"))
    lines = stated.get_all("Classifier") or []
    classes = [line.rpartition("::")[2].strip() for line in lines if line.startswith("License")]
    return expression or ", ".join(classes) or (text if len(text) <= _LONGEST_LICENCE else "")
