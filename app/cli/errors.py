"""Which exceptions are the user's or the machine's to mend, rather than faults of the program."""


class CommandError(Exception):
    """A command that cannot be done as asked. The message names the value, the fault and the remedy."""


def explain(error: Exception) -> str:
    """Say in one line what happened; a fault of the program itself is called one."""
    said = " ".join(str(error).split())
    if is_expected(error):
        return said
    return (
        f"Slipstand itself failed ({type(error).__name__}: {said}). "
        "Set SLIPSTAND_DEBUG=1, run it again and report what it prints"
    )


def is_expected(error: Exception) -> bool:
    """Tell whether the error's own message is written for the user."""
    # Imported late: the trees are only needed once something went wrong.
    from analysis.record import AnalysisError
    from app.acquisition.errors import AcquisitionError
    from app.runs.errors import RunError
    from config.schema import ConfigError
    from drivers.errors import DriverError

    known = (CommandError, AnalysisError, AcquisitionError, RunError, ConfigError, DriverError, OSError)
    return isinstance(error, known)
