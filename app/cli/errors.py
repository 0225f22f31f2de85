"""Which exceptions are the user's or the machine's to mend, rather than faults of the program."""

from collections.abc import Sequence

from app.runs.errors import internal_error
from messages.message import MessageError, lacking_resource


class CommandError(Exception):
    """A command that cannot be done as asked. The message names the value, the fault and the remedy."""


def alternatives(values: Sequence[str]) -> str:
    """List values as "a, b or c"."""
    return " or ".join(filter(None, (", ".join(values[:-1]), values[-1])))


def error_text(error: Exception) -> str:
    """Say in one line what happened; a fault of the program itself is called one."""
    if lacking := lacking_resource(error):
        return str(lacking)
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}. Check the path, its rights and its disk"
    return " ".join(str(error).split()) if is_expected(error) else str(internal_error(error))


def is_expected(error: Exception) -> bool:
    """Tell whether the error's own message is written for the user."""
    return isinstance(error, CommandError | MessageError | OSError)
