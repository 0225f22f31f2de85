"""Events that presenters get from workers and from the connection."""

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from app.presenters.base import Progress
from messages.message import Message

Answer = TypeVar("Answer")


@dataclass(frozen=True, slots=True)
class TaskFailure:
    message: Message
    is_cancelled: bool = False


@dataclass(frozen=True, slots=True)
class TaskDone(Generic[Answer]):
    argument: Any
    answer: Answer


@dataclass(frozen=True, slots=True)
class TaskFailed:
    argument: Any
    message: Message
    is_cancelled: bool = False


@dataclass(frozen=True, slots=True)
class TaskProgress:
    argument: Any
    progress: Progress


@dataclass(frozen=True, slots=True)
class SimulationStarted:
    """A simulated stand has started and is being connected."""

    series: str
    true_friction: float
