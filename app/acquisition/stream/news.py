"""What can happen to a stream beside samples."""

from dataclasses import dataclass
from typing import TypeAlias

from app.acquisition.messages import EndReason, Event, Reconnected, Reconnecting


@dataclass(frozen=True, slots=True)
class DeviceLost:
    """The device is gone, or says nothing intelligible: it is looked for from now on."""

    reason: EndReason
    message: str
    tried: str = ""
    """Why the latest attempt to find it failed."""


@dataclass(frozen=True, slots=True)
class SearchFailed:
    """It is not found, for another reason than before."""

    message: str


@dataclass(frozen=True, slots=True)
class DeviceFound:
    """It is back at `url`, and samples of `gap_s` are missing."""

    url: str
    gap_s: float

    @property
    def message(self) -> str:
        """In a sentence."""
        return f"the device was away and is back at {self.url}: {self.gap_s:.2f} s are missing and marked"


@dataclass(frozen=True, slots=True)
class StreamNotice:
    """Samples come, but something is to be said of them, or of this computer."""

    message: str


StreamEvent: TypeAlias = DeviceLost | SearchFailed | DeviceFound | StreamNotice


@dataclass(frozen=True, slots=True)
class StreamFault:
    """Why a run must end that waits for samples."""

    reason: EndReason
    message: str


def engine_events(news: StreamEvent) -> tuple[Event, ...]:
    """What to tell the owner of the engine."""
    match news:
        case DeviceLost() | SearchFailed():
            return (Reconnecting(news.message),)
        case DeviceFound():
            return (Reconnected(news.gap_s, news.message),)
        case StreamNotice():
            return ()
