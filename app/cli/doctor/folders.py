"""Folders of settings and runs: which are in use and why, their rights, room, and what lies unfinished."""

import datetime
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from app.cli.doctor import Finding, fail, ok, warn
from app.runs.creation import check_folder
from app.runs.disk import free_bytes, leftover_files
from app.runs.errors import RunError
from app.runs.journal import unfinished_journals
from app.runs.paths import journal_fallback_folders, recordings_directory
from config import files
from config.schema import ConfigError, Gauge, GaugeCheck, Settings

_ONEDRIVE_VARIABLES = ("OneDrive", "OneDriveCommercial", "OneDriveConsumer")
_SYNCHRONISED = (
    "OneDrive", "Dropbox", "Google Drive", "Nextcloud", "iCloud", "com~apple~CloudDocs",
)  # fmt: skip
"""Beginnings of the names of folders that programs copy to other computers."""
_NAMED = 5
_LITTLE_BYTES, _NONE_BYTES = 2_000_000_000, 100_000_000


def check_folders() -> Iterator[Finding]:
    """Look at settings, recordings and journals."""
    yield from _settings()
    try:
        settings = files.load_settings()
    except ConfigError as error:
        yield fail("settings.toml", str(error), f"Correct it, or put {files.settings_path()} aside")
        settings = Settings()
    recordings = recordings_directory(settings)
    yield from _recordings(recordings, "settings.toml" if settings.recordings else "")
    yield check_unfinished_runs([recordings, *journal_fallback_folders()])
    yield check_leftovers(recordings)


def _why(variable: str, chosen_in: str = "") -> str:
    if os.environ.get(variable):
        return variable
    return chosen_in or ("checkout" if files.is_checkout() else "user's")


def _settings() -> Iterator[Finding]:
    yield ok("settings", f"{files.config_directory()} ({_why('SLIPSTAND_CONFIG')})")
    for name, load in (("stand.toml", files.load_stand), ("gauges.toml", files.load_gauges)):
        path = files.settings_file(name)
        try:
            load()
        except ConfigError as error:
            yield fail(name, str(error), f"Correct {path}, or put it aside to take the shipped one")
        else:
            yield ok(name, f"{path}{'' if path.parent == files.config_directory() else ' (shipped)'}")


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
    yield from check_synchronised(folder)
    yield check_disk_space(free_bytes(there))


def check_synchronised(folder: Path) -> Iterator[Finding]:
    """Warn of a folder that a program copies to elsewhere, as OneDrive copies Documents."""
    roots = {os.environ.get(name, "").casefold() for name in _ONEDRIVE_VARIABLES} - {""}
    names = [(place.name, str(place).casefold()) for place in (folder, *folder.parents)]
    found = next((name for name, path in names if path in roots or name.startswith(_SYNCHRONISED)), None)
    if found is not None:
        yield warn(
            "synchronised folder",
            f"{folder} lies in {found}, which opens files while they are recorded",
            "Record to a folder outside it: set it in the settings, or SLIPSTAND_RECORDINGS",
        )


def check_disk_space(free: int | None) -> Finding:
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


def check_unfinished_runs(places: list[Path]) -> Finding:
    """Say where runs were cut short."""
    left = {place: len(unfinished_journals(place)) for place in places}
    told = [f"{number} in {place}" for place, number in left.items() if number]
    if not told:
        return ok("unfinished runs", "none")
    first = next(place for place, number in left.items() if number)
    return warn("unfinished runs", ", ".join(told), f"Rebuild them: slipstand recover {first}")


def check_leftovers(folder: Path) -> Finding:
    """Say which temporary files a killed program has left among the runs."""
    left = leftover_files(folder)
    if not left:
        return ok("leftovers", "none")
    size = sum(path.stat().st_size for path in left)
    names = ", ".join(str(path) for path in left[:_NAMED]) + (" and others" if left[_NAMED:] else "")
    count = "1 temporary file" if len(left) == 1 else f"{len(left)} temporary files"
    said = f"{count} of killed programs, {size / 1e6:.1f} MB; the runs are unharmed"
    return warn("leftovers", said, f"Delete them: {names}")


_GAUGES: dict[Literal["table", "relative"], str] = {"table": "gauge 1", "relative": "gauge 2"}
_SOON = datetime.timedelta(days=30)
_REMEDY = "Calibrate the gauge: slipstand calibrate"


def check_gauges() -> Iterator[Finding]:
    """Look at calibrations and checks of both gauges; unreadable settings are told with the folders."""
    try:
        gauges = files.load_gauges()
    except ConfigError:
        return
    today = datetime.datetime.now().astimezone().date()
    for name, said in _GAUGES.items():
        yield check_calibration(said, getattr(gauges, name), today)
    try:
        last = {check.gauge: check for check in files.load_checks().latest_checks(gauges)}
    except ConfigError as error:
        yield fail("gauge checks", str(error), f"Correct {files.checks_path()}, or put it aside")
        return
    for name, said in _GAUGES.items():
        yield check_last_gauge_check(said, last.get(name))


def check_calibration(said: str, gauge: Gauge, today: datetime.date) -> Finding:
    """Tell of what day a calibration is, and until when it holds."""
    subject = f"calibration of {said}"
    of_day = f"of {gauge.date}" if gauge.date else "of no stated day"
    if gauge.valid_until is None:
        return ok(subject, f"{of_day}; no last day is stated")
    held = f"{of_day}, valid until {gauge.valid_until}"
    if gauge.is_expired(today):
        return warn(subject, f"{held}, which is past", _REMEDY)
    if gauge.valid_until - today <= _SOON:
        return warn(subject, f"{held}, in {(gauge.valid_until - today).days} days", _REMEDY)
    return ok(subject, held)


def check_last_gauge_check(said: str, check: GaugeCheck | None) -> Finding:
    """Tell how the last check of the calibration in use came out."""
    subject = f"check of {said}"
    if check is None:
        return ok(subject, "this calibration was not checked yet; see: slipstand calibrate check")
    verdict = "passed" if check.passed else "failed"
    message = (
        f"{verdict} on {check.at:%Y-%m-%d %H:%M}: {check.deviation_m * 1e6:+.0f} um at"
        f" {check.expected_m * 1e3:g} mm, {check.tolerance_m * 1e6:.0f} um allowed"
    )
    return ok(subject, message) if check.passed else warn(subject, message, _REMEDY)
