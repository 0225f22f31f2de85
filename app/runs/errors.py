"""What can go wrong with a run file. Each message names the file, the fault and the remedy in one line."""


class RunError(Exception):
    """Root of the run file errors."""

    stored_samples: int = 0
    """Rows that the file holds all the same, where its writer has failed."""


def internal_error_text(error: Exception) -> str:
    """Say in one line that the program itself failed."""
    said = " ".join(str(error).split())
    return (
        f"Slipstand itself failed ({type(error).__name__}: {said}). "
        "Set SLIPSTAND_DEBUG=1, run it again and report what it prints"
    )


class RunNotFoundError(RunError):
    """There is no such file, or it cannot be opened by this user."""


class NotARunError(RunError):
    """A file, but not a run of this program: other bytes, or HDF5 of another kind."""


class BeingRecordedError(RunError):
    """The run is still being written; live samples come from the engine, not from the file."""


class DamagedRunError(RunError):
    """A run file whose contents contradict themselves, cannot be read, or want too much memory or time."""


class ValidationTimeoutError(RunError):
    """A file that nobody came to look over in time, since computer or disk were busy; it may be sound."""


class RunExistsError(RunError):
    """The file to be written exists already; nothing is ever overwritten."""


class MetadataError(RunError, ValueError):
    """A fact about a run that cannot be stored as it stands."""


class DiskFullError(RunError):
    """No space is left for the run; what was recorded until then is in the file."""


class WriteError(RunError):
    """The run could not be written for another reason than space."""


class WriterBehindError(WriteError):
    """The writer cannot keep up; the run can still be closed."""


class UnsuitableRunError(RunError):
    """A good run that does not hold what was asked of it."""


class ImportFileError(RunError):
    """A foreign record that cannot be read as told: names file, row or column, and remedy."""


class ExtraMissingError(RunError):
    """A format whose library is not installed."""


class ClusterError(RunError):
    """A cluster that cannot do the work: nobody answers there, or its workers are not fit for it."""
