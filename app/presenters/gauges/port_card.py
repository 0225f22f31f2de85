"""What is known of a port of this computer, as a value."""

from dataclasses import dataclass

from app.presenters.base import EMPTY_CHIP, Chip
from app.presenters.start.state import ConnectForm


@dataclass(frozen=True, slots=True)
class PortCard:
    """A port of this computer, and what was found on it.

    Attributes
    ----------
    url : str
    identity : str
        Chip or board, and USB numbers.
    finding : Chip
        What speaks there, or why nobody knows; empty before it was looked at.
    words : tuple of str
        What else is to be known: how it was tested, what stands in the way, remedies.
    suggestion : ConnectForm, optional
        How to record from it.
    """

    url: str
    identity: str = ""
    finding: Chip = EMPTY_CHIP
    words: tuple[str, ...] = ()
    suggestion: ConnectForm | None = None
