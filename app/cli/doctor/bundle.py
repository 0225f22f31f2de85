"""`slipstand doctor --bundle`: one file to attach to a bug report. It holds no recording."""

import json
import os
import platform
import sys
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path

from app.cli.doctor import Finding
from app.log import log_folder
from app.version import __version__
from config.files import config_directory
from drivers.port import list_ports
from drivers.registry import DRIVERS

_VARIABLES = ("SLIPSTAND_", "NUMBA_", "QT_", "OMP_", "LANG", "DISPLAY", "WAYLAND_DISPLAY")
"""Beginnings of the names of environment variables that change how the program works."""


def write_bundle(path: Path, findings: Sequence[Finding]) -> list[str]:
    """Write the bundle. Returns a line on each of its files; the same lines stand in its README.txt."""
    lines = []
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, description, text in _files(findings):
            bundle.writestr(name, text)
            lines.append(f"{name}: {description}")
        bundle.writestr("README.txt", "\n".join([*lines, ""]))
    return lines


def _files(findings: Sequence[Finding]) -> Iterator[tuple[str, str, str]]:
    yield "findings.json", "findings of slipstand doctor", _json([asdict(finding) for finding in findings])
    yield "versions.json", "versions of program, Python, system and libraries", _json(_versions())
    yield "environment.json", "environment variables that the program reads", _json(_environment())
    yield (
        "ports.json",
        "serial ports with their USB identities",
        _json([asdict(port) for port in list_ports()]),
    )
    protocols = {info.name: info.verified for info in DRIVERS.values()}
    yield "protocols.json", "protocols, and what each was verified against", _json(protocols)
    for path in sorted(config_directory().glob("*.toml")):
        yield f"settings/{path.name}", f"your {path.name}", _text(path)
    for path in sorted(log_folder().glob("*.log*")):
        yield f"log/{path.name}", "log of one kind of process, without sample values", _text(path)


def _versions() -> dict[str, object]:
    whole = (
        found
        for found in metadata.distributions()
        if found.read_text("METADATA") or found.read_text("PKG-INFO")  # an upgrade that failed leaves none
    )
    installed = {found.metadata["Name"]: found.version for found in whole}
    return {
        "slipstand": __version__,
        "python": sys.version,
        "system": platform.platform(),
        "machine": platform.machine(),
        "processors": os.cpu_count(),
        "libraries": dict(sorted(installed.items())),
    }


def _environment() -> dict[str, str]:
    return {name: value for name, value in sorted(os.environ.items()) if name.startswith(_VARIABLES)}


def _json(document: object) -> str:
    return json.dumps(document, indent=2, ensure_ascii=False)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        return f"cannot be read: {error}"
