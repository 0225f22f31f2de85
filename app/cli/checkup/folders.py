"""Folders of settings and runs: which are in use and why, their rights, room, and what lies unfinished."""

import os
from collections.abc import Iterator
from pathlib import Path

from app.cli.checkup.finding import Finding, fail, ok, warn
from app.runs.disk import free_bytes
from app.runs.errors import RunError
from app.runs.journals import unfinished_journals
from app.runs.places import journal_refuges, recordings_directory
from app.runs.self_check import check_folder
from config.files import (
    config_directory,
    is_checkout,
    load_gauges,
    load_settings,
    load_stand,
    personal_file,
    settings_file,
)
from config.schema import ConfigError, Settings

_LITTLE_BYTES, _NONE_BYTES = 2_000_000_000, 100_000_000


def check_folders() -> Iterator[Finding]:
    """Look at settings, recordings and journals."""
    yield from _settings()
    try:
        settings = load_settings()
    except ConfigError as error:
        yield fail("settings.toml", str(error), f"Correct it, or put {personal_file()} aside")
        settings = Settings()
    recordings = recordings_directory(settings)
    yield from _recordings(recordings, "settings.toml" if settings.recordings else "")
    yield unfinished([recordings, *journal_refuges()])


def _why(variable: str, chosen_in: str = "") -> str:
    if os.environ.get(variable):
        return variable
    return chosen_in or ("checkout" if is_checkout() else "user's")


def _settings() -> Iterator[Finding]:
    yield ok("settings", f"{config_directory()} ({_why('SLIPSTAND_CONFIG')})")
    for name, load in (("stand.toml", load_stand), ("gauges.toml", load_gauges)):
        path = settings_file(name)
        try:
            load()
        except ConfigError as error:
            yield fail(name, str(error), f"Correct {path}, or put it aside to take the shipped one")
        else:
            yield ok(name, f"{path}{'' if path.parent == config_directory() else ' (shipped)'}")


def _recordings(folder: Path, chosen_in: str) -> Iterator[Finding]:
    there = next((place for place in (folder, *folder.parents) if place.exists()), folder)
    absent = "" if there == folder else ", made by the first run"
    said = f"{folder} ({_why('SLIPSTAND_RECORDINGS', chosen_in)}{absent})"
    if not there.is_dir():
        yield fail(
            "recordings", f"{said}: {there} is no folder", "Set SLIPSTAND_RECORDINGS to another folder"
        )
        return
    try:
        check_folder(there)
    except RunError as error:
        yield fail("recordings", str(error), "Give yourself the right to write, or set SLIPSTAND_RECORDINGS")
    else:
        yield ok("recordings", f"{said}; run files can be written there")
    yield room(free_bytes(there))


def room(free: int | None) -> Finding:
    """Judge the free bytes of the disk of the runs; None where nobody can tell."""
    if free is None:
        return warn("free disk", "the file system does not tell", "Make sure of some GB by other means")
    said = f"{free / 1e9:.1f} GB"
    if free < _NONE_BYTES:
        return fail(
            "free disk", f"only {said}", "Free some space, or set SLIPSTAND_RECORDINGS to another disk"
        )
    if free < _LITTLE_BYTES:
        return warn("free disk", f"only {said}", "Free some space: an hour at 2 kHz takes about 0.5 GB")
    return ok("free disk", said)


def unfinished(places: list[Path]) -> Finding:
    """Say where runs were cut short."""
    left = {place: len(unfinished_journals(place)) for place in places}
    told = [f"{number} in {place}" for place, number in left.items() if number]
    if not told:
        return ok("unfinished runs", "none")
    first = next(place for place, number in left.items() if number)
    return warn("unfinished runs", ", ".join(told), f"Rebuild them: slipstand recover {first}")
