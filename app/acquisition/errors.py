"""Everything that can go wrong with the engine. Each message names the fault and the remedy."""

from app.acquisition.messages import EndReason
from messages.message import Message, MessageError


class AcquisitionError(MessageError):
    """Root of the acquisition errors."""


class EngineFailedError(AcquisitionError):
    """The engine could not do what it was asked; the message is the engine's own."""


class EngineDiedError(AcquisitionError):
    """The engine's process ended without a word."""


class RunSettingsError(AcquisitionError, ValueError):
    """Settings that no run can have."""


class DiskSpaceError(AcquisitionError):
    """The disk has less room than a run takes."""


class RingError(AcquisitionError):
    """A file that is no ring of this version, or can no longer be read."""


class JournalError(AcquisitionError):
    """The journal cannot be created or written: no room, no rights, or too slow a disk."""


class JournalFullError(JournalError):
    """The disk that holds the journal is full."""


class StreamEndedError(AcquisitionError):
    """No more samples will come: device lost, silent, or this computer too slow."""

    def __init__(self, reason: EndReason, message: Message) -> None:
        super().__init__(message)
        self.reason = reason


class RecoveryError(AcquisitionError):
    """A journal from which no run can be built, or not now. It stays as it is."""
