"""Starts the real engine and the real simulated stand, each in its process."""

from dataclasses import dataclass

from app.acquisition.engine_client import EngineClient
from app.acquisition.messages import PortSettings
from app.presenters.connection import Engine, Simulation
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import published_row, settings_file


@dataclass(frozen=True, slots=True)
class ProcessLauncher:
    """Starts processes of this installation."""

    def engine(self, port: PortSettings) -> Engine:
        """Start an engine that connects to `port`; whether it can, its events tell. Raises OSError.

        It takes the settings that are in use now: a calibration may have been made meanwhile.
        """
        stand, gauges = (str(settings_file(name)) for name in ("stand.toml", "gauges.toml"))
        return EngineClient.start(port, stand, gauges, low_latency=True)

    def simulation(self, options: SimulatedStandOptions) -> Simulation:
        """Start a simulated stand. Raises SimulatedStandError, ConfigError."""
        row = published_row(options.series)
        friction = row.friction_dynamic if options.friction is None else options.friction
        return RunningStand(SimulatedStand.start(options), options, friction)


@dataclass(frozen=True, slots=True)
class RunningStand:
    """A simulated stand with what a reader of it must know."""

    _stand: SimulatedStand
    _options: SimulatedStandOptions
    true_friction: float

    @property
    def port(self) -> PortSettings:
        """How to read it."""
        return PortSettings(
            url=self._stand.port, protocol=self._options.protocol, device=self._options.device
        )

    @property
    def series(self) -> str:
        """What it runs."""
        return self._options.series

    def truth(self) -> Truth:
        """What is true of it, as last told."""
        return self._stand.truth()

    def disturb(self, text: str) -> None:
        """Let something happen to it. Raises SettingsError, SimulatedStandError."""
        self._stand.disturb(text)

    def stop(self) -> None:
        """End it."""
        self._stand.stop()
