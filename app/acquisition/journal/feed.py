"""From the thread that reads the port into the journal, before anything is decoded."""

from collections import deque

from app.acquisition.errors import JournalError
from app.acquisition.journal.journal import Journal
from app.acquisition.stream.intake import Read


class JournalFeed:
    """Puts each read into a journal as it comes; whoever has decoded it asks where it stands.

    Parameters
    ----------
    journal : Journal
    """

    def __init__(self, journal: Journal) -> None:
        self.decoded = 0
        """Reads whose place was asked for."""
        self._journal = journal
        self._starts: deque[int] = deque()
        self._failure: JournalError | None = None

    def take(self, read: Read) -> None:
        """Put a read into the journal, as a tap of the intake; after a failure no more: none is skipped."""
        try:
            if self._failure is None:
                self._starts.append(self._journal.append(read.data, read.arrival_ns))
        except JournalError as error:
            self._failure = error

    def next_start(self) -> int:
        """Byte of the journal at which the next read begins, in the order in which they came.

        Raises
        ------
        JournalError
            It did not get there.
        """
        if not self._starts and self._failure is not None:
            raise self._failure
        self.decoded += 1
        return self._starts.popleft()
