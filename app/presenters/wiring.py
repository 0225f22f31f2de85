"""Brings the presenters together with the real engine, simulated stand, settings and folders."""

from app.presenters.analysis_task import analyse_run
from app.presenters.launcher import ProcessLauncher
from app.presenters.record.presenter import Bench
from app.presenters.session import Session
from app.presenters.start.state import ConnectForm, PortChoice, ProtocolChoice, StartState
from app.presenters.window import WindowPresenter
from app.presenters.worker import Worker
from app.runs.journals import unfinished_journals
from app.runs.places import journal_folders, recordings_directory
from app.simulated_stand.options import SimulatedStandOptions
from config.files import load_gauges, load_stand, published_table
from config.schema import Gauges


def make_window_presenter(simulation: SimulatedStandOptions | None = None) -> WindowPresenter:
    """Everything behind the window, connected to nothing yet. Raises ConfigError.

    Parameters
    ----------
    simulation : SimulatedStandOptions, optional
        The simulated stand that the start page offers.
    """
    simulation = simulation or SimulatedStandOptions()
    gauges = load_gauges()
    bench = Bench(load_stand(), gauges, tuple(published_table()), recordings_directory())
    return WindowPresenter(
        Session(ProcessLauncher()),
        Worker(),
        analyse_run,
        bench,
        _start_state(bench, gauges, simulation),
        present_ports,
        Worker(),
        (Worker(), Worker()),
        lambda: sum(len(unfinished_journals(folder)) for folder in journal_folders(bench.directory)),
        simulation,
    )


def present_ports() -> tuple[PortChoice, ...]:
    """Serial ports of this computer."""
    from drivers.port import list_ports

    return tuple(PortChoice(port.device, port.description) for port in list_ports())


def _start_state(bench: Bench, gauges: Gauges, simulation: SimulatedStandOptions) -> StartState:
    device = gauges.device
    return StartState(
        all_series=bench.all_series,
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
