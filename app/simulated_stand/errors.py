"""What can go wrong with a simulated stand."""

from drivers.errors import DriverError


class SimulatedStandError(DriverError):
    """The simulated stand could not be set up or started."""
