"""Free space of the disk for a run: before it, and while it lasts."""

import threading
from dataclasses import dataclass
from pathlib import Path

from app.acquisition.errors import DiskSpaceError
from app.acquisition.messages import RunSettings
from app.runs.disk import FILES_OF_RUN, MARGIN_BYTES, free_bytes, free_files
from messages.i18n import N_
from messages.message import EMPTY, Message, message

ROW_BYTES = 41  # of one sample in a run file: time, two readings, status, two counts as float64

_RECORD_BYTES = 24.0  # header of a journal record; a read is one record
_READS_PER_S = 250.0  # upper bound: one read each 4 ms
_LONGEST_S = 20.0  # longest time from release to end of a run that lasts until rest
_CLOSING_BYTES = 4 * MARGIN_BYTES
_CLOSING_S = 3.0  # a run is ended while there is space for so many more seconds, and to close it regularly
_POLL_PERIOD_S = 0.5
_WARN_S = 60.0  # the operator is warned while there is space for so many more seconds


@dataclass(frozen=True, slots=True)
class DiskDemand:
    """What a run writes."""

    rate_hz: float
    wire_bytes_per_s: float  # what the device sends

    @property
    def journal_bytes_per_s(self) -> float:
        return self.wire_bytes_per_s + _RECORD_BYTES * _READS_PER_S

    @property
    def run_bytes_per_s(self) -> float:
        """Rows of the run, and the received bytes that are copied in at its end."""
        return ROW_BYTES * self.rate_hz + self.wire_bytes_per_s

    @property
    def bytes_per_s(self) -> float:
        return self.run_bytes_per_s + self.journal_bytes_per_s

    def of_run(self, run: RunSettings) -> float:
        """Bytes that a run takes for certain, its journal included, until that is removed."""
        length_s = (run.duration_s or _LONGEST_S) + (run.pretrigger_s if run.trigger == "pullback" else 0.0)
        return _CLOSING_BYTES + length_s * self.bytes_per_s

    def of_waiting(self, run: RunSettings) -> float:
        return self.journal_bytes_per_s * run.trigger_timeout_s if run.trigger == "pullback" else 0.0


def check_disk_space(folder: Path, run: RunSettings, demand: DiskDemand) -> Message:
    """Return a warning about the free space, or EMPTY. Raises DiskSpaceError if a run does not fit."""
    free, files = free_bytes(folder), free_files(folder)
    needed = demand.of_run(run)
    if files is not None and 0 < files < FILES_OF_RUN:  # file systems that know no number may tell 0
        template = N_(
            "{folder}: the disk takes only {files} more files, and this run {needed}. Remove some files"
            " or record to another disk"
        )
        raise DiskSpaceError(template, folder=folder, files=files, needed=FILES_OF_RUN)
    if free is None:
        return EMPTY
    if free < needed:
        template = N_(
            "{folder}: the disk has {free} left, and this run takes {needed}. Free some space or record"
            " to another disk"
        )
        raise DiskSpaceError(template, folder=folder, free=_megabytes(free), needed=_megabytes(needed))
    if free < needed + demand.of_waiting(run):
        waiting_s = (free - needed) / demand.journal_bytes_per_s
        template = N_(
            "the disk has {free} left, enough for this run if the release comes within {minutes:.0f} minutes:"
            " free some space"
        )
        return message(template, free=_megabytes(free), minutes=waiting_s / 60)
    return EMPTY


class DiskSpaceMonitor:
    """Reads the free space of one folder after another, twice a second; the folder need not exist.

    None follows no folder until `begin`.
    """

    def __init__(self, folder: Path | None) -> None:
        self._demand: DiskDemand | None = None
        self._is_warned = False
        self.free_bytes: int | None = None  # of the folder that is followed; None if unknown
        self._changing = threading.Lock()
        self._stopping = threading.Event()
        self._follow(folder, None)

    def begin(self, folder: Path, demand: DiskDemand) -> None:
        """Follow the folder in which a run is recorded; waits for its disk."""
        free = free_bytes(folder)
        self._demand, self._is_warned = demand, False
        self._follow(folder, free)

    def _follow(self, folder: Path | None, free: int | None) -> None:
        """Follow another folder by another thread: the disk of the one before may hang."""
        with self._changing:
            self._stopping.set()
            self._folder, self.free_bytes, self._stopping = folder, free, threading.Event()
        followed = folder, self._stopping
        self._thread = threading.Thread(target=self._poll, args=followed, name="free space", daemon=True)
        self._thread.start()

    def check(self, journal_bytes: int) -> Message:
        """Return a new warning for the run, or EMPTY. Raises DiskSpaceError when it must end."""
        free = self.free_bytes
        if free is None or self._demand is None:
            return EMPTY
        spare_s = (free - journal_bytes - _CLOSING_BYTES) / self._demand.bytes_per_s
        if spare_s < _CLOSING_S:
            template = N_(
                "{folder}: the disk has only {free} left, which closing this run takes. Free some"
                " space or record to another disk"
            )
            raise DiskSpaceError(template, folder=self._folder, free=_megabytes(free))
        if spare_s > _WARN_S or self._is_warned:
            return EMPTY
        self._is_warned = True
        template = N_("the disk has {free} left, enough for {spare_s:.0f} s more: free some space now")
        return message(template, free=_megabytes(free), spare_s=spare_s)

    def stop(self) -> None:
        """End, without waiting for a disk that hangs."""
        self._stopping.set()

    def _poll(self, folder: Path | None, stopping: threading.Event) -> None:
        while not stopping.is_set():
            free = None if folder is None else free_bytes(folder)
            with self._changing:
                if not stopping.is_set():
                    self.free_bytes = free
            stopping.wait(_POLL_PERIOD_S)


def _megabytes(size: float) -> str:
    return f"{size / 1e6:.1f} MB"
