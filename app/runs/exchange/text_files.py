"""Text files of any size, encoding and line end, as pieces of whole lines."""

import codecs
import contextlib
import io
import re
import string
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

from app.runs.errors import ImportFileError
from messages.i18n import N_
from messages.message import option

PIECE_BYTES = 1 << 20
HEAD_BYTES = 1 << 18
"""Header, units and the first rows of a record lie within them; a header of more is none."""
_START_BYTES = 4096
LINE_BYTES = 1 << 20
"""More without a line end is no text of a record."""
_BOMS = (
    (codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")
)  # fmt: skip
_ZEROS = 0.01
"""Share of zero bytes from which a text is UTF-16: half of the bytes of digits and line ends are."""
_UNSHOWN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
_HIGH = re.compile(rb"[A-Za-z]?[\x80-\xff]+[A-Za-z]?")
_SYMBOLS = frozenset(range(0x80, 0xC0)) - {0xA8, 0xB8}
"""In Windows-1251 and -1252; both have the sign for micro and that for degrees at the same places."""
_ASCII_LETTERS = string.ascii_letters.encode()
_RUSSIAN = ("cp1251", "cp866")
_SMALL_RUSSIAN = frozenset("абвгдежзийклмнопрстуфхцчшщъыьэюяё")


class Piece(NamedTuple):
    """Whole lines of a file, each ended by a newline."""

    line: int
    """Number of the first line, from 1."""
    data: bytes
    """In the file's encoding, or in UTF-8 where that is UTF-16: digits are ASCII."""
    end_bytes: int  # of the file that have been read


@dataclass(frozen=True, slots=True)
class TextFile:
    """A text file whose encoding is known."""

    path: Path
    encoding: str
    size_bytes: int
    bom_bytes: int

    def pieces(self, piece_bytes: int = PIECE_BYTES) -> Iterator[Piece]:
        """Read the file. Raises ImportFileError."""
        line, rest = 1, b""
        with _open(self.path) as file:
            file.seek(self.bom_bytes)
            for data in self._plain(file, piece_bytes):
                whole, newline, rest = (rest + data).rpartition(b"\n")
                if newline:
                    yield Piece(line, whole + newline, file.tell())
                    line += whole.count(b"\n") + 1
                if len(rest) > LINE_BYTES:
                    raise line_too_long(self.path, line)
        if rest:
            yield Piece(line, rest + b"\n", self.size_bytes)

    def first_lines(self, count: int, characters: int) -> tuple[str, ...]:
        """First lines as they are, cut to so many characters; what cannot be shown is replaced."""
        with _open(self.path) as file:
            data = file.read(HEAD_BYTES)[self.bom_bytes :]
        text = codecs.getincrementaldecoder(self.encoding)("replace").decode(data)
        lines = re.split(r"\r\n|\n|\r", text)[:count]
        return tuple(_UNSHOWN.sub("\ufffd", line[:characters]) for line in lines)

    def decode(self, data: bytes) -> str:
        """Text of a piece."""
        return data.decode("utf-8" if self.encoding.startswith("utf-16") else self.encoding, "replace")

    def tail_lines(self, place: float, count: int) -> list[str]:
        """Whole lines behind a place (share of the file); none of a short file or of UTF-16."""
        if self.size_bytes < 2 * HEAD_BYTES or self.encoding.startswith("utf-16"):
            return []
        with _open(self.path) as file:
            file.seek(max(0, int(self.size_bytes * place)))
            data = file.read(HEAD_BYTES)
        lines = re.split(r"\r\n|\n|\r", self.decode(data))
        return lines[1:-1][:count]

    def _plain(self, file: BinaryIO, piece_bytes: int) -> Iterator[bytes]:
        """Bytes with newlines only, and digits in ASCII."""
        decoder = (
            codecs.getincrementaldecoder(self.encoding)("replace") if "utf-16" in self.encoding else None
        )
        is_after_return = False
        while data := file.read(piece_bytes):
            if decoder is not None:
                data = decoder.decode(data).encode()
            if is_after_return and data.startswith(b"\n"):
                data = data[1:]
            is_after_return = data.endswith(b"\r")
            if b"\r" in data:
                data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            yield data


def line_too_long(path: Path, line: int) -> ImportFileError:
    """Error for a line that is no row."""
    return ImportFileError(
        "{path}, line {line}: it has more than {bytes} bytes. Give a file with a row a line",
        path=path,
        line=line,
        bytes=LINE_BYTES,
    )


def open_text(path: Path, encoding: str | None = None) -> TextFile:
    """Find out the encoding of a text file, if it is not given. Raises ImportFileError."""
    with _open(path) as file:
        head = file.read(HEAD_BYTES)
        size = file.seek(0, io.SEEK_END)
    bom, found = next(((bom, name) for bom, name in _BOMS if head.startswith(bom)), (b"", ""))
    if encoding is not None:
        found = _known_encoding(encoding, found)
    return TextFile(path, found or _guess(path, head), size, len(bom))


def _known_encoding(name: str, by_bom: str) -> str:
    """Name as Python has it, of UTF-16 and of encodings whose digits are ASCII. Raises ImportFileError."""
    found, is_known = "", False
    with contextlib.suppress(LookupError, UnicodeError):
        found = codecs.lookup(name).name.removesuffix("-sig")
        is_known = found.startswith("utf-16") or "0\n".encode(found) == b"0\n"
    if not is_known:
        template = N_("{option} {encoding!r} is not known. Give for example utf-8, cp1251 or cp1252")
        raise ImportFileError(template, option=option("--encoding"), encoding=name)
    if found == "utf-16":
        return by_bom if by_bom.startswith(found) else "utf-16-le"
    return found


def _open(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except FileNotFoundError:
        raise ImportFileError(
            "{path}: there is no such file. Give the path of a CSV file", path=path
        ) from None
    except OSError as error:
        template = N_("{path}: cannot be read ({strerror}). Give a readable CSV file")
        raise ImportFileError(template, path=path, strerror=error.strerror) from None


def _guess(path: Path, head: bytes) -> str:
    start = head[:_START_BYTES]  # a logger may have made room with zeros behind its rows
    if b"\0" in start:
        if found := _guess_16_bit(start):
            return found
        raise ImportFileError(
            "{path} is not a text file. Export it as CSV from the program that wrote it", path=path
        )
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return _guess_8_bit(head)
    return "utf-8"


def _guess_16_bit(start: bytes) -> str:
    """UTF-16 without a mark at its beginning: zeros at even places or at odd ones; "" of no text."""
    even, odd = start[::2].count(0), start[1::2].count(0)
    if min(even, odd) > 0 or max(even, odd) < _ZEROS * len(start):
        return ""
    name = "utf-16-le" if odd else "utf-16-be"
    try:
        text = codecs.getincrementaldecoder(name)().decode(start)
    except UnicodeDecodeError:
        return ""
    return "" if _UNSHOWN.search(text) else name


def _guess_8_bit(head: bytes) -> str:
    """Western where letters beyond ASCII stand beside others, else the Russian one that fits better."""
    western, runs = 0, b""
    for run in _HIGH.findall(head):
        high = run.strip(_ASCII_LETTERS)
        if len(high) < len(run):
            western += len(high)
        elif len(high) > 1 or high[0] not in _SYMBOLS:
            runs += high
    if western > len(runs) or not runs:
        return "cp1252"
    texts = {name: runs.decode(name, "replace") for name in _RUSSIAN}
    return max(_RUSSIAN, key=lambda name: sum(letter in _SMALL_RUSSIAN for letter in texts[name]))
