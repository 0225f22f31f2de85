"""Everything that can go wrong between the plug and the sample block."""


class DriverError(Exception):
    """Root of all driver errors. The message names the value, the fault and the remedy."""


class PortUnavailableError(DriverError):
    """The port does not exist, is busy, or may not be opened by this user."""


class DeviceLostError(DriverError):
    """The port was there and is gone: unplugged, or the other end closed."""


class NoDataError(DriverError):
    """The port is open but no good frame came; says what came instead."""


class ProtocolError(DriverError):
    """The device answered, but not what its protocol allows."""


class SettingsError(DriverError, ValueError):
    """A device setting that its driver does not know or cannot use."""
