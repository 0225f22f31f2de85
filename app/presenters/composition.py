"""Composition root of the window: presenters with the real engine, simulated stand, settings and folders."""

import datetime
import os
from functools import partial
from pathlib import Path

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import PortSettings
from app.presenters.connection import Connection
from app.presenters.error_reports import ErrorReporter, error_report
from app.presenters.navigator import ConnectForm, StandContext
from app.presenters.notices import NoticeSources
from app.presenters.recent import RecentItems
from app.presenters.settings_screen import PersonalSettings, SettingsFile
from app.presenters.start_screen import PortChoice, StartState
from app.presenters.window import WindowContext, WindowPresenter
from app.presenters.worker import Worker, WorkerPool
from app.runs.journal import unfinished_journals
from app.runs.paths import RECORDINGS, journal_folders, recordings_directory
from app.runs.unattended import read_notes
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config import files
from config.schema import ConfigError, RecentUse, Settings
from drivers.registry import DRIVERS
from messages.i18n import N_


def read_personal() -> PersonalSettings:
    """Read the person's settings; defaults with the reason where they cannot be read."""
    settings, fault = Settings(), ""
    try:
        settings = files.load_settings()
    except ConfigError as error:
        fault = str(error)
    recordings = recordings_directory(settings)
    overridden = RECORDINGS if os.environ.get(RECORDINGS) else ""
    return PersonalSettings(settings, fault, str(recordings), overridden, _list_files, _save)


def make_window_presenter(
    simulation: SimulatedStandOptions | None = None,
    personal: PersonalSettings | None = None,
    errors: ErrorReporter | None = None,
) -> WindowPresenter:
    """Make the presenters of the window, not connected to a device. Raises ConfigError.

    Start offers a simulated stand with options `simulation`. Settings are read unless `personal` is given.
    """
    simulation = simulation or SimulatedStandOptions(on_demand=True)
    personal = personal or read_personal()
    errors = errors or ErrorReporter()
    stand, gauges = files.load_stand(), files.load_gauges()
    context = StandContext(stand, gauges, stand.all_series, Path(personal.recordings))
    return WindowPresenter(
        Connection(partial(start_engine, directory=context.directory), SimulatedStand.start, errors.report),
        Worker(errors.report),
        WorkerPool(errors.report),
        WindowContext(
            context,
            _start_state(context, simulation),
            personal,
            simulation,
            _list_ports,
            _notice_sources(context.directory),
            _read_recent(errors),
            files.save_stand,
        ),
        errors,
    )


def _notice_sources(directory: Path) -> NoticeSources:
    def count_unfinished() -> int:
        return sum(len(unfinished_journals(folder)) for folder in journal_folders(directory))

    return NoticeSources(count_unfinished, partial(read_notes, directory))


def _list_files() -> tuple[SettingsFile, ...]:
    return (
        SettingsFile(N_("These settings"), str(files.settings_path())),
        SettingsFile(N_("Stand and masses"), str(files.settings_file("stand.toml"))),
        SettingsFile(N_("Gauges"), str(files.settings_file("gauges.toml"))),
    )


def _save(settings: Settings) -> Path | None:
    return files.save_settings(settings, _today())


def _list_ports() -> tuple[PortChoice, ...]:
    from drivers.port import list_ports

    return tuple(
        PortChoice(port.device, port.description, port.identity.removeprefix(port.device).strip())
        for port in list_ports()
    )


def _read_recent(errors: ErrorReporter) -> RecentItems:
    def report(error: ConfigError) -> None:
        errors.report(error_report(error))

    try:
        recent = files.load_recent()
    except ConfigError as error:
        report(error)
        recent = RecentUse()
    return RecentItems(recent, lambda changed: files.save_recent(changed, _today()), report)


def _today() -> datetime.date:
    return datetime.datetime.now().astimezone().date()


def _start_state(context: StandContext, simulation: SimulatedStandOptions) -> StartState:
    device = context.gauges.device
    form = ConnectForm(
        protocol=device.protocol,
        baud="" if device.baud is None else str(device.baud),
        parity=device.parity,
        stop_bits=str(device.stop_bits),
        rate_hz="" if device.rate_hz is None else f"{device.rate_hz:g}",
    )
    protocols = tuple(driver for driver in DRIVERS.values() if driver.available)
    all_series, folder = tuple(files.published_table()), str(context.directory)
    return StartState(all_series, simulation.series, protocols, form=form, recordings=folder)


def start_engine(port: PortSettings, directory: Path) -> EngineClient:
    """Start an engine that connects to `port`; whether it can, its events tell. Raises OSError.

    It takes the settings that are in use now: a calibration may have been made meanwhile. `directory` is the
    folder of the runs.
    """
    stand, gauges = (str(files.settings_file(name)) for name in ("stand.toml", "gauges.toml"))
    return EngineClient.start(port, stand, gauges, low_latency=True, directory=str(directory))
