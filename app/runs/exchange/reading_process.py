"""Read foreign files in a child process with limits.

A file of another program may be damaged or made to harm: its reader may crash, hang or take all memory.
"""

import atexit
import contextlib
import functools
import importlib
import itertools
import math
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from app import child_process
from app.child_process import START_S, CommandReader, EventSender, RequestProcess
from app.log import start_log
from app.runs.errors import ExtraMissingError, ImportFileError, RunError
from app.runs.exchange import csv_bulk
from app.runs.exchange.foreign_files import find_format
from app.runs.exchange.importing import (
    Floats,
    ForeignRecord,
    ImportPlan,
    RecordFacts,
    check_plan,
    read_record,
)
from app.runs.exchange.memory_limit import limit_memory
from app.runs.exchange.recognition import FileSurvey, ParseOptions, survey_file
from messages.i18n import N_
from messages.message import Message, Option, Value

MEMORY_BYTES = 1 << 30
PROGRESS_S = 10.0
"""A reader whose share of the file does not grow for so long hangs."""
_IDLE_S = 60.0
_LARGE_BYTES = 1 << 26
"""A process that has read a record of more ends, since its libraries need more than the start of another."""
_OPTION, _FLOAT = "\0option", "\0float"
"""Templates of an `Option` and of a float that is not finite, which JSON does not keep."""


class ReadRequest(msgspec.Struct, frozen=True, tag=True):
    """Read a record into files `0.npy` (time) and `1.npy`, `2.npy` (cells) of a folder."""

    path: str
    plan: ImportPlan
    folder: str


class SurveyRequest(msgspec.Struct, frozen=True, tag=True):
    """Look into a file for its columns."""

    path: str
    options: ParseOptions


class ReaderReady(msgspec.Struct, frozen=True, tag=True):
    """The process takes requests."""


class ReadingProgress(msgspec.Struct, frozen=True, tag=True):
    """Share of a file that has been read."""

    share: float
    is_loading: bool = False
    """Whether a library is being loaded, which may take long on a busy computer."""


class RecordRead(msgspec.Struct, frozen=True, tag=True):
    """The record is in the folder."""

    facts: RecordFacts
    columns: int


class FileSurveyed(msgspec.Struct, frozen=True, tag=True):
    """What can be seen of the file."""

    survey: FileSurvey


class ReadingFault(msgspec.Struct, frozen=True, tag=True):
    """The file cannot be read."""

    message: Message
    is_extra_missing: bool = False


Request = ReadRequest | SurveyRequest
Event = ReaderReady | ReadingProgress | RecordRead | FileSurveyed | ReadingFault
_decode_event: Callable[[bytes], Event] = child_process.json_decoder(Event)


class ReadingProcess:
    """Reads files, one after another, for several threads."""

    def __init__(self) -> None:
        self._process: RequestProcess[Request, Event] = RequestProcess(__name__, _decode_event)
        self._turn = threading.Lock()
        self._removing = threading.Lock()
        self._left: list[str] = []

    @property
    def pid(self) -> int | None:
        return self._process.pid

    @contextlib.contextmanager
    def read(
        self, path: Path, plan: ImportPlan, report: Callable[[float], object] = lambda _: None
    ) -> Iterator[ForeignRecord]:
        """Read a file as `importing.read_record` does; its arrays hold until the context ends.

        Raises RunError, also for a file over which the reader crashes, hangs or needs too much memory.
        """
        check_plan(plan)
        with self._temporary_folder() as folder:
            answer = self._ask(ReadRequest(str(path.absolute()), plan, folder), path, report)
            if not isinstance(answer, RecordRead):
                raise _crashed(path)
            if sum(file.stat().st_size for file in Path(folder).iterdir()) > _LARGE_BYTES:
                with self._turn:
                    self._process.stop()
            yield _mapped_record(answer, folder)  # not held here: Windows keeps files that arrays lie in

    def survey(
        self, path: Path, options: ParseOptions, report: Callable[[float], object] = lambda _: None
    ) -> FileSurvey:
        """Look into a file as `recognition.survey_file` does. Raises RunError."""
        answer = self._ask(SurveyRequest(str(path.absolute()), options), path, report)
        if not isinstance(answer, FileSurveyed):
            raise _crashed(path)
        return replace(answer.survey, fault=_unpacked(answer.survey.fault))

    def stop(self) -> None:
        self._process.stop()
        self._remove_folders()

    @contextlib.contextmanager
    def _temporary_folder(self) -> Iterator[str]:
        folder = tempfile.mkdtemp(prefix="slipstand-import-")
        try:
            yield folder
        finally:
            self._remove_folders(folder)

    def _remove_folders(self, *folders: str) -> None:
        """Remove folders, and those that could not be before: Windows keeps files that arrays lie in."""
        with self._removing:
            self._left += folders
            for folder in self._left:
                shutil.rmtree(folder, ignore_errors=True)
            self._left = [folder for folder in self._left if Path(folder).exists()]

    def _ask(self, request: Request, path: Path, report: Callable[[float], object]) -> Event:
        with self._turn:
            if self._process.has_ended:  # since the last file, so not over this one
                self._process.stop()
            if not self._process.send(request):
                raise RunError("the process that reads foreign files does not start. Run `slipstand doctor`")
            event = self._last_event(path, report)
        if isinstance(event, ReadingFault):
            kind: type[RunError] = ExtraMissingError if event.is_extra_missing else ImportFileError
            raise kind(_unpacked(event.message))
        return event

    def _last_event(self, path: Path, report: Callable[[float], object]) -> Event:
        """Wait for an answer as long as the share of the file that is read grows."""
        limit_s, share = PROGRESS_S, -1.0
        until_s = time.perf_counter() + limit_s
        while isinstance(event := self._next(path, until_s, limit_s), ReadingProgress):
            if event.is_loading or limit_s != PROGRESS_S or event.share > share:
                limit_s = START_S if event.is_loading else PROGRESS_S
                until_s = time.perf_counter() + limit_s
            share = max(share, event.share)
            report(share)
        return event

    def _next(self, path: Path, until_s: float, limit_s: float) -> Event:
        try:
            event = self._process.receive(max(until_s - time.perf_counter(), 0.0))
        except TimeoutError:
            template = N_(
                "{path}: reading it shows no progress for {seconds:g} s. The file is damaged, or its disk too"
                " slow: copy it to this computer and try again"
            )
            raise ImportFileError(template, path=path, seconds=limit_s) from None
        if event is None:
            raise _crashed(path)
        return event


@functools.cache
def shared_reading_process() -> ReadingProcess:
    """The reading process that this process keeps."""
    reader = ReadingProcess()
    atexit.register(reader.stop)
    return reader


def main() -> None:
    """Answer requests until stdin ends: one a line as JSON, with events on stdout."""
    start_log("reader")
    child_process.ignore_session_signals()
    limit_memory(MEMORY_BYTES)
    events: EventSender[Event] = EventSender(
        child_process.reserve_stdout(), lambda event: isinstance(event, ReadingProgress)
    )
    decoder = child_process.LineDecoder(child_process.json_decoder(Request))
    requests: CommandReader[Request] = CommandReader.of_stdin(decoder.feed)
    events.send(ReaderReady())
    while not requests.is_closed:
        if (request := requests.take(_IDLE_S)) is not None:
            _load_reader(Path(request.path), events.send)
            events.send(_answer(request, lambda share: events.send(ReadingProgress(share))))
    events.close()


def _load_reader(path: Path, send: Callable[[Event], object]) -> None:
    """Load what reads a file, before time without progress counts."""
    found = find_format(path)
    modules = (csv_bulk.LIBRARY,) if found is None else (*found.readers, found.module_name)
    send(ReadingProgress(0.0, is_loading=True))
    for name in modules:
        with contextlib.suppress(ImportError, MemoryError):  # `_answer` says so
            importlib.import_module(name)
    send(ReadingProgress(0.0))


def _answer(request: Request, report: Callable[[float], object]) -> Event:
    path = Path(request.path)
    try:
        if isinstance(request, SurveyRequest):
            survey = survey_file(path, request.options, report)
            return FileSurveyed(replace(survey, fault=_packed(survey.fault)))
        files = (Path(request.folder) / f"{number}.npy" for number in itertools.count(1))
        record = read_record(path, request.plan, report, lambda cells: _on_disk(next(files), cells))
        _on_disk(Path(request.folder) / "0.npy", record.time_s)
        facts = msgspec.structs.replace(record.facts, notes=tuple(map(_packed, record.facts.notes)))
        return RecordRead(facts, 1 + len(record.cells))
    except RunError as error:
        return ReadingFault(_packed(error.message), isinstance(error, ExtraMissingError))
    except MemoryError:
        template = N_("{path} needs more than {gigabytes:g} GB of memory. Export a part of it")
        return ReadingFault(ImportFileError(template, path=path, gigabytes=MEMORY_BYTES / 2**30).message)
    except OSError as error:
        template = N_("{path}: cannot be read ({reason}). Check the file and its disk")
        return ReadingFault(ImportFileError(template, path=path, reason=error.strerror or str(error)).message)


def _on_disk(path: Path, column: Floats) -> Floats:
    """Column as a file, whose memory is free until it is read."""
    np.save(path, np.ascontiguousarray(column))
    return np.load(path, mmap_mode="r")  # type: ignore[no-any-return]


def _crashed(path: Path) -> ImportFileError:
    return ImportFileError(
        "{path}: its reader crashed over it, or needs more than {gigabytes:g} GB of memory. Export it again,"
        " or a part of it",
        path=path,
        gigabytes=MEMORY_BYTES / 2**30,
    )


def _packed(text: Message) -> Message:
    """Message that JSON keeps."""
    return Message(
        text.template, {name: _packed_value(value) for name, value in text.values.items()}, text.plural
    )


def _packed_value(value: Value) -> Value:
    if isinstance(value, Option):
        return Message(_OPTION, {"name": value.template})
    if isinstance(value, float) and not math.isfinite(value):
        return Message(_FLOAT, {"text": str(value)})
    return _packed(value) if isinstance(value, Message) else value


def _mapped_record(answer: RecordRead, folder: str) -> ForeignRecord:
    """Record whose arrays lie in files of the folder."""
    time, *readings = (
        np.load(Path(folder) / f"{number}.npy", mmap_mode="r") for number in range(answer.columns)
    )
    facts = msgspec.structs.replace(answer.facts, notes=tuple(map(_unpacked, answer.facts.notes)))
    return ForeignRecord(facts, time, tuple(readings))


def _unpacked(text: Message) -> Message:
    values: dict[str, Any] = {name: _unpacked_value(value) for name, value in text.values.items()}
    return Message(text.template, values, text.plural)


def _unpacked_value(value: Value) -> Value:
    if not isinstance(value, Message):
        return value
    if value.template == _FLOAT:
        return float(str(value.values["text"]))
    return Option(str(value.values["name"])) if value.template == _OPTION else _unpacked(value)
