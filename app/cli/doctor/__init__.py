"""What `slipstand doctor` looks at; each module one side of the installation."""

from dataclasses import dataclass
from enum import StrEnum


class FindingState(StrEnum):
    """How well it stands."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of `slipstand doctor`; what is not ok has a remedy."""

    subject: str
    state: FindingState
    message: str
    remedy: str = ""


def ok(subject: str, message: str) -> Finding:
    """All is well."""
    return Finding(subject, FindingState.OK, message)


def warn(subject: str, message: str, remedy: str) -> Finding:
    """Work is possible, but something is lost or uncertain."""
    return Finding(subject, FindingState.WARN, message, remedy)


def fail(subject: str, message: str, remedy: str) -> Finding:
    """Something does not work."""
    return Finding(subject, FindingState.FAIL, message, remedy)
