"""Errors of the acquisition. Each message names the fault and the remedy."""

from app.acquisition.messages import EndReason
from messages.message import Message, MessageError


class AcquisitionError(MessageError):
    """Root of the acquisition errors."""


class EngineFailedError(AcquisitionError):
    """The engine could not execute a command; the message is its own."""


class EngineDiedError(AcquisitionError):
    """The process of the engine ended without an error message."""


class RunSettingsError(AcquisitionError, ValueError):
    """Settings that no run can have."""


class DiskSpaceError(AcquisitionError):
    """The disk has less room than a run takes."""


class RingError(AcquisitionError):
    """A file that is no live ring, or can no longer be read."""


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
    """A journal from which no run can be rebuilt, or not now. It stays as it is."""
