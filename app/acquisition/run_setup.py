"""Settings, metadata and journal of a run, checked and made before the table is pulled back."""

import datetime
import math
import os
import platform
import time
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from app.acquisition.errors import RunSettingsError
from app.acquisition.journal.journal import Journal, create_journal
from app.acquisition.journal.records import JournalHeader
from app.acquisition.messages import PortSettings, RunEnded, RunSettings
from app.acquisition.stream.live_stream import LiveStream
from app.runs.journal import SUFFIX
from app.runs.metadata import RunMetadata, RunSource, create_metadata
from app.runs.paths import journal_fallback_folders, run_stem
from app.version import __version__
from config.files import load_checks
from config.schema import Device, Filter, Gauges, Stand
from drivers.samples import ChannelFilter
from messages.i18n import N_

TRIGGERS = ("pullback", "none")
PRETRIGGER_MAX_S = 60.0


def complete_port_settings(port: PortSettings, device: Device) -> PortSettings:
    """Port settings, completed by the calibration file where its device has the same protocol."""
    if device.protocol != port.protocol:
        return port
    return msgspec.structs.replace(
        port,
        baud=device.baud if port.baud is None else port.baud,
        parity=device.parity if port.parity is None else port.parity,
        stop_bits=device.stop_bits if port.stop_bits is None else port.stop_bits,
        rate_hz=device.rate_hz if port.rate_hz is None else port.rate_hz,
        device=_texts(device.settings) | port.device,
    )


def _texts(settings: Mapping[str, Any], before: str = "") -> dict[str, str]:
    """Settings as text; those of a table within them, as of gauge 2's device, with its name and a dot."""
    texts: dict[str, str] = {}
    for key, value in settings.items():
        if isinstance(value, Mapping):
            texts |= _texts(value, f"{before}{key}.")
        else:
            texts[before + key] = str(value)
    return texts


def check_run_settings(settings: RunSettings) -> None:
    """Raise RunSettingsError for settings that no run can have."""
    if settings.trigger not in TRIGGERS:
        template = N_("trigger {trigger!r} is not known: give {triggers}")
        raise RunSettingsError(template, trigger=settings.trigger, triggers=" or ".join(TRIGGERS))
    if not 0.0 <= settings.pretrigger_s <= PRETRIGGER_MAX_S:
        template = N_("pretrigger {pretrigger_s:g} s: give 0 to {longest_s:g} s")
        raise RunSettingsError(template, pretrigger_s=settings.pretrigger_s, longest_s=PRETRIGGER_MAX_S)
    for name in ("duration_s", "trigger_timeout_s", "pullback_tolerance_m"):
        value = getattr(settings, name)
        if value is not None and not 0.0 < value < math.inf:
            raise RunSettingsError(
                "{name} = {value:g} must be a finite number above 0", name=name, value=value
            )


def build_metadata(
    settings: RunSettings, stand: Stand, gauges: Gauges, stream: LiveStream, *, simulated: bool = False
) -> RunMetadata:
    """Metadata of a run when it is armed. Raises ConfigError, MetadataError."""
    return create_metadata(
        stand,
        with_device_filters(gauges, stream.filters),
        datetime.datetime.now().astimezone(),
        series=settings.series,
        pullback_m=settings.pullback_m,
        table_mass_kg=settings.table_mass_kg,
        plate_mass_kg=settings.plate_mass_kg,
        operator=settings.operator,
        note=settings.note,
        conditions=settings.conditions,
        device=stream.identity,
        port=stream.port_identity,
        rate_hz=stream.rate_hz,
        host=platform.node(),
        gauge_checks=load_checks().latest_checks(gauges),
        stated_source=RunSource.SIMULATED if simulated else None,
    )


def with_device_filters(gauges: Gauges, filters: tuple[ChannelFilter | None, ChannelFilter | None]) -> Gauges:
    """Calibrations with the filters of the device where none is stated."""
    pairs = zip(("table", "relative"), (gauges.table, gauges.relative), filters, strict=True)
    filled = {
        name: gauge.replace(filter=Filter("sinc", own.order, own.corner_hz, 0.0))
        for name, gauge, own in pairs
        if own is not None and gauge.filter is None
    }
    return gauges.replace(**filled)


def create_run_journal(port: PortSettings, settings: RunSettings, metadata: RunMetadata) -> Journal:
    """Create the journal of a run beside the file that the run will have. Raises JournalError."""
    stem = run_stem(metadata.start_time, metadata.series or "run")
    parts = (stem, str(os.getpid()), str(time.perf_counter_ns() // 1_000_000))
    path = Path(settings.directory).absolute() / ("_".join(parts) + SUFFIX)
    header = JournalHeader(port, settings, metadata, str(uuid.uuid4()), f"slipstand {__version__}")
    return create_journal(path, header, journal_fallback_folders())


class RunSequence:
    """Runs that were requested in a row, and how many are left."""

    def __init__(self) -> None:
        self._next: RunSettings | None = None
        self._remaining = 0
        self._done = 0

    @property
    def is_repeat(self) -> bool:
        """The run that is recorded now was armed without being asked for."""
        return self._done > 0

    def begin(self, run: RunSettings, count: int) -> None:
        self._next, self._remaining, self._done = next_run(run), count - 1, 0

    def stop(self) -> None:
        self._remaining = 0

    def next_after(self, ended: RunEnded) -> tuple[RunEnded, RunSettings | None]:
        """Add how many runs follow, and return the next one; only a normal end is followed."""
        if not ended.ended.is_normal or self._next is None or self._remaining == 0:
            self._remaining = self._done = 0
            return ended, None
        run, remaining = self._next, self._remaining
        self._next, self._remaining, self._done = next_run(run), remaining - 1, self._done + 1
        return msgspec.structs.replace(ended, remaining=remaining), run


def next_run(run: RunSettings) -> RunSettings:
    """The run after `run`: the same, with its run-in number counted up where it has one."""
    number = run.conditions.run_in_number
    if number is None:
        return run
    conditions = run.conditions.replace(run_in_number=number + 1)
    return msgspec.structs.replace(run, conditions=conditions)
