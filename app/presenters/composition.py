"""Brings the presenters together with the real engine, simulated stand, settings and folders."""

import datetime
import os
from pathlib import Path

from app.presenters.analysis_task import analyse_run
from app.presenters.connection import Connection
from app.presenters.error_reports import ErrorReporter
from app.presenters.launcher import ProcessLauncher
from app.presenters.record.state import StandContext
from app.presenters.settings.presenter import PersonalSettings
from app.presenters.settings.state import SettingsFile
from app.presenters.start.state import ConnectForm, PortChoice, ProtocolChoice, StartState
from app.presenters.window import WindowPresenter
from app.presenters.worker import Worker
from app.runs.journal import unfinished_journals
from app.runs.paths import RECORDINGS, journal_folders, recordings_directory
from app.simulated_stand.options import SimulatedStandOptions
from config.files import (
    load_gauges,
    load_settings,
    load_stand,
    published_table,
    save_settings,
    settings_file,
    settings_path,
)
from config.schema import ConfigError, Gauges, Settings
from messages.i18n import N_


def read_personal() -> PersonalSettings:
    """A person's settings as they are kept; the defaults, and why, where they cannot be read."""
    settings, fault = Settings(), ""
    try:
        settings = load_settings()
    except ConfigError as error:
        fault = str(error)
    recordings = recordings_directory(settings)
    files = (
        SettingsFile(N_("These settings"), str(settings_path())),
        SettingsFile(N_("Stand"), str(settings_file("stand.toml"))),
        SettingsFile(N_("Gauges"), str(settings_file("gauges.toml"))),
    )
    overridden = RECORDINGS if os.environ.get(RECORDINGS) else ""
    return PersonalSettings(settings, fault, str(recordings), overridden, files, _SettingsStore())


def make_window_presenter(
    simulation: SimulatedStandOptions | None = None,
    personal: PersonalSettings | None = None,
    faults: ErrorReporter | None = None,
) -> WindowPresenter:
    """Everything behind the window, connected to nothing yet. Raises ConfigError.

    Parameters
    ----------
    simulation : SimulatedStandOptions, optional
        The simulated stand that the start page offers.
    personal : Personal, optional
        A person's settings; read unless given.
    faults : Faults, optional
        Where faults of the program come together.
    """
    simulation, personal, faults = (
        simulation or SimulatedStandOptions(),
        personal or read_personal(),
        faults or ErrorReporter(),
    )
    gauges = load_gauges()
    stand = load_stand()
    bench = StandContext(stand, gauges, stand.all_series, Path(personal.recordings))
    return WindowPresenter(
        Connection(ProcessLauncher(), faults.report),
        Worker(faults.report),
        analyse_run,
        bench,
        _start_state(bench, gauges, simulation),
        list_port_choices,
        Worker(faults.report),
        (Worker(faults.report), Worker(faults.report)),
        lambda: sum(len(unfinished_journals(folder)) for folder in journal_folders(bench.directory)),
        simulation,
        personal,
        faults,
        Worker(faults.report),
        Worker(faults.report),
        Worker(faults.report),
    )


class _SettingsStore:
    """Keeps settings in the person's file."""

    def save(self, settings: Settings) -> Path | None:
        return save_settings(settings, datetime.datetime.now().astimezone().date())


def list_port_choices() -> tuple[PortChoice, ...]:
    """Serial ports of this computer."""
    from drivers.port import list_ports

    return tuple(PortChoice(port.device, port.description) for port in list_ports())


def _start_state(bench: StandContext, gauges: Gauges, simulation: SimulatedStandOptions) -> StartState:
    device = gauges.device
    return StartState(
        all_series=tuple(published_table()),
        series=simulation.series,
        protocols=_protocols(),
        form=ConnectForm(
            protocol=device.protocol,
            baud="" if device.baud is None else str(device.baud),
            rate_hz="" if device.rate_hz is None else f"{device.rate_hz:g}",
        ),
        recordings=str(bench.directory),
    )


def _protocols() -> tuple[ProtocolChoice, ...]:
    from drivers.registry import PROTOCOLS

    return tuple(
        ProtocolChoice(entry.name, entry.title, entry.default_baud, entry.verified)
        for entry in PROTOCOLS.values()
        if entry.available
    )
