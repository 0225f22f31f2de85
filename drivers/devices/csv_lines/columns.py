"""Layout of a line of values."""

from dataclasses import dataclass
from enum import StrEnum

from drivers.errors import SettingsError
from messages.i18n import N_


class Column(StrEnum):
    """Content of a column."""

    TIME_US = "time_us"
    TIME_MS = "time_ms"
    TIME_S = "time_s"
    TABLE = "table"
    RELATIVE = "relative"
    VALUE = "value"  # the reading of a device with one gauge
    SEQUENCE = "sequence"
    XOR = "xor"  # two hex digits: exclusive or of all characters before its separator
    CRC = "crc"  # four hex digits: CRC-16/CCITT-FALSE of all characters before its separator
    UNIT = "unit"  # a word, such as kg; blanks may part it from the number before it
    STATUS = "status"  # a word or a mark that tells whether the reading is good
    WORD = "word"  # characters that are not used, without a blank
    EMPTY = "empty"  # nothing, as after a separator at the end of a line
    IGNORE = "ignore"  # a number that is not used


TIME_UNIT_S = {Column.TIME_US: 1e-6, Column.TIME_MS: 1e-3, Column.TIME_S: 1.0}
CHECKSUMS = (Column.XOR, Column.CRC)
_READINGS = (Column.TABLE, Column.RELATIVE, Column.VALUE)
SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "space": " "}
DECIMALS = {"point": ".", "comma": ","}
LINE_ENDS = {"crlf": "\r\n", "lf": "\n", "cr": "\r"}
_OF_NUMBERS = "0123456789+-."
MAX_STATUS_BYTES = 8
_MIN_BITS, _MAX_BITS = 8, 52  # a double holds whole numbers of up to 53 bits


@dataclass(frozen=True, slots=True)
class LineFormat:
    """Columns of a line and how they are written. Raises SettingsError if they contradict each other."""

    columns: tuple[Column, ...] = (Column.TIME_US, Column.TABLE, Column.RELATIVE)
    """From left to right: `table` and `relative` once each, or `value` once of a device with one gauge; at
    most one time column, one `sequence` and one checksum, which is last; others in any number."""
    separator: str = ","  # one character; a blank means any number of blanks
    decimal: str = "."
    comment: str = "#%;/"
    """First characters of lines that are skipped."""
    time_bits: int = 32
    """Width of the counters of a time in us or ms and of a sequence, which wrap; 0: they do not wrap."""
    sequence_bits: int = 32
    unit: str = ""
    """The word in `unit` columns; "" for any word."""
    overload_status: tuple[str, ...] = ()
    """Words in the status column of an overload, whose value may lack."""
    fault_status: tuple[str, ...] = ()  # words in the status column of a line without a reading
    good_status: str = "ok"  # what a simulated device sends there with a good reading
    line_end: str = "\r\n"  # what a simulated device sends; any of CR, LF and both is read

    def __post_init__(self) -> None:
        _check_columns(self.columns)
        if len(self.separator) != 1 or self.separator in _OF_NUMBERS + "eE\r\n":
            template = N_("separator {separator!r} cannot part numbers: give one of , ; tab space")
            raise SettingsError(template, separator=self.separator)
        if not self.comment.isascii() or any(mark in _OF_NUMBERS for mark in self.comment):
            template = N_("comment {comment!r} cannot mark comments: give characters such as #%;")
            raise SettingsError(template, comment=self.comment)
        if self.unit and not (self.unit.isascii() and self.unit.isalpha()):
            raise SettingsError("unit {unit!r} is no word: give letters, for example kg", unit=self.unit)
        self._check_status()
        if self.decimal not in (".", ","):
            raise SettingsError("decimal {decimal!r} is not known: give . or ,", decimal=self.decimal)
        if self.decimal == self.separator:
            template = N_("separator and decimal are both {mark!r}: give another separator")
            raise SettingsError(template, mark=self.decimal)
        for name, bits in (("time_bits", self.time_bits), ("sequence_bits", self.sequence_bits)):
            if bits != 0 and not _MIN_BITS <= bits <= _MAX_BITS:
                template = N_("{name} {bits} is out of range: give {least} to {most}, or 0 for no wrap")
                raise SettingsError(template, name=name, bits=bits, least=_MIN_BITS, most=_MAX_BITS)

    def _check_status(self) -> None:
        words = (*self.overload_status, *self.fault_status)
        if words and Column.STATUS not in self.columns:
            template = N_("overload_status and fault_status {words} need a status column: name it in columns")
            raise SettingsError(template, words=words)
        counters = (self.time_column, Column.SEQUENCE)
        at = [number for number, column in enumerate(self.columns) if column in counters]
        if self.overload_status and at and self.columns.index(Column.STATUS) < max(at):
            template = N_(
                "columns {columns}: a line of an overload may end after its status, name time before it"
            )
            raise SettingsError(template, columns=",".join(self.columns))
        for word in (*words, self.good_status):
            is_possible = word.isascii() and word.isprintable() and not {" ", self.separator} & set(word)
            if not (is_possible and 0 < len(word) <= MAX_STATUS_BYTES):
                template = N_(
                    "status {word!r} cannot be: give 1 to {most} characters without blank or separator"
                )
                raise SettingsError(template, word=word, most=MAX_STATUS_BYTES)

    @property
    def channels(self) -> int:
        return 1 if Column.VALUE in self.columns else 2

    @property
    def time_column(self) -> Column | None:
        return next((column for column in self.columns if column in TIME_UNIT_S), None)

    @property
    def time_wrap(self) -> int:
        """Value at which the time wraps, in units of its column; 0: it does not."""
        wraps = self.time_bits and self.time_column in (Column.TIME_US, Column.TIME_MS)
        return 1 << self.time_bits if wraps else 0

    @property
    def sequence_wrap(self) -> int:
        return 1 << self.sequence_bits if self.sequence_bits else 0

    @property
    def checksum(self) -> Column | None:
        return self.columns[-1] if self.columns[-1] in CHECKSUMS else None


def _check_columns(columns: tuple[Column, ...]) -> None:
    readings = [column for column in columns if column in _READINGS]
    names = ",".join(columns)
    if sorted(readings) not in ([Column.RELATIVE, Column.TABLE], [Column.VALUE]):
        template = N_("columns {columns} need table and relative exactly once each, or value alone")
        raise SettingsError(template, columns=names)
    if sum(column in TIME_UNIT_S for column in columns) > 1 or columns.count(Column.SEQUENCE) > 1:
        template = N_("columns {columns} hold more than one time or sequence: name others ignore")
        raise SettingsError(template, columns=names)
    if columns.count(Column.STATUS) > 1:
        raise SettingsError("columns {columns} hold more than one status: name others word", columns=names)
    if any(column in CHECKSUMS for column in columns[:-1]):
        raise SettingsError("columns {columns}: a checksum (xor, crc) can only be the last", columns=names)
