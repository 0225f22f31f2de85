"""Errors of drivers: what can go wrong between the port and the sample block."""

from messages.message import MessageError


class DriverError(MessageError):
    """Root of all driver errors. The message names the value, the fault and the remedy."""


class PortUnavailableError(DriverError):
    """The port does not exist, is busy, or may not be opened by this user."""


class DeviceLostError(DriverError):
    """The port was open and is gone: unplugged, or closed by the other end."""


class NoDataError(DriverError):
    """The port is open and no good frame arrived. The message names what arrived instead."""


class ProtocolError(DriverError):
    """The device answered in a way that its protocol does not allow."""


class SettingsError(DriverError, ValueError):
    """A device setting that the driver does not know or cannot use."""


class QueueFullError(DriverError):
    """The receiver of reads cannot take more. The reader ends, because it may not skip bytes."""
