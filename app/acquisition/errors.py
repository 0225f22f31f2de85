"""Everything that can go wrong with the engine. Each message names the fault and the remedy."""


class AcquisitionError(Exception):
    """Root of the acquisition errors."""


class EngineFailedError(AcquisitionError):
    """The engine could not do what it was asked; the message is the engine's own."""


class EngineDiedError(AcquisitionError):
    """The engine's process ended without a word."""


class RingError(AcquisitionError):
    """A file that is no ring of this version, or can no longer be read."""


class JournalError(AcquisitionError):
    """The journal cannot be created or written: no room, no rights, or too slow a disk."""


class ProtocolUnknownError(AcquisitionError):
    """A protocol that no driver of this program speaks."""
