"""Date-times and times of day in cells of text: which form they have, and their nanoseconds."""

import datetime
import re
from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from messages.message import Message, message, option

DateOrder = Literal["dmy", "mdy", "ymd"]
NS = 1_000_000_000
_HOUR_NS = 3600 * NS
DAY_NS = 24 * _HOUR_NS
_MONTHS = {
    name: number
    for number, names in enumerate(
        (
            ("jan", "янв"), ("feb", "фев"), ("mar", "mär", "мар"), ("apr", "апр"),
            ("may", "mai", "мая", "май"),
            ("jun", "июн"), ("jul", "июл"), ("aug", "авг"), ("sep", "сен"), ("oct", "okt", "окт"),
            ("nov", "ноя"), ("dec", "dez", "дек"),
        ),
        start=1,
    )
    for name in names
}  # fmt: skip
_DATES = (
    r"(?P<y>\d{4})(?P<s>[-/.])(?P<m>\d{1,2})(?P=s)(?P<d>\d{1,2})",
    r"(?P<a>\d{1,2})(?P<s>[-/.])(?P<b>\d{1,2})(?P=s)(?P<y>\d{4}|\d{2})(?!\d)",
    r"(?P<d>\d{1,2})[-/. ](?P<n>[^\W\d_]{3})[^\W\d_]*[-/. ,]+(?P<y>\d{4}|\d{2})(?!\d)",
    r"(?P<n>[^\W\d_]{3})[^\W\d_]*\.? (?P<d>\d{1,2}),? (?P<y>\d{4})",
    r"(?P<y>\d{4})(?P<m>\d\d)(?P<d>\d\d)",
)
_TIME = (
    r"(?P<H>\d{1,2}):(?P<M>\d\d)(?::(?P<S>\d\d)(?:[.,:](?P<f>\d{1,9}))?)?(?:\s*(?P<p>[AaPp])\.?[Mm]\.?)?"
    r"(?:\s*(?P<z>Z|UTC|GMT)?(?P<o>[+-]\d{2}(?::?\d{2})?)?)"
)
_COMPACT_TIME = (
    r"(?P<H>\d\d)(?P<M>\d\d)(?P<S>\d\d)(?:[.,](?P<f>\d{1,9}))?(?P<z>Z)?(?P<o>[+-]\d{2}(?::?\d{2})?)?"
)
_WEEKDAY = r"(?:[^\W\d_]{2,9}\.?,? )?"
_FORMS = tuple(
    re.compile(rf"\s*{_WEEKDAY if date else ''}{date}{gap}{time}\s*")
    for date, gap, time in (
        *((date, r"(?:[T_,;]|\s|,\s)\s*", _TIME) for date in _DATES),
        (_DATES[-1], "[T_ ]", _COMPACT_TIME),
        (r"(?P<n>[^\W\d_]{3}) {1,2}(?P<d>\d{1,2})", " ", _TIME + r" (?P<y>\d{4})"),  # of `ctime` in C
        ("", "", _TIME),
        ("", "", r"(?P<M>\d{1,2}):(?P<S>\d\d)[.,](?P<f>\d{1,9})"),  # mm:ss.0 of Excel
        *((date, "", "") for date in _DATES[:-1]),
    )
)
_NUMBERS = "ymdabHMSf"
_SHOWN = 40  # characters of a cell in a message


def find_form(cell: str) -> re.Pattern[str] | None:
    """Form of a cell that is a date, a time of day or both; None of another."""
    return next((form for form in _FORMS if form.fullmatch(cell)), None)


def date_order(cells: Iterable[str]) -> DateOrder | None:
    """Order of day and month in dates such as 3/11/2026; None where all of them may be read either way.

    Between points the day stands first. Dates that say by themselves what is what count as `ymd`.
    """
    either = False
    for cell in cells:
        form = find_form(cell)
        found = form.fullmatch(cell) if form else None
        if found is None or "a" not in found.re.groupindex:
            continue
        first, second = int(found["a"]), int(found["b"])
        if found["s"] == "." or first > 12:
            return "dmy"
        if second > 12:
            return "mdy"
        either = either or first != second
    return None if either else "ymd"


def has_date(form: re.Pattern[str]) -> bool:
    """Tell whether cells of a form have a date."""
    return "y" in form.groupindex


def has_time(form: re.Pattern[str]) -> bool:
    """Tell whether cells of a form have a time of day."""
    return "M" in form.groupindex


class StampError(ValueError):
    """A cell is no stamp of the form that the column has."""


def stamp_fault(cell: str) -> Message:
    """Fault of a cell that is no stamp of the form that the column has."""
    return message("{cell!r} is no time like those above. Correct it or delete the line", cell=cell[:_SHOWN])


class StampColumn:
    """Turns cells of one column into nanoseconds, piece by piece."""

    def __init__(self, form: re.Pattern[str], order: DateOrder) -> None:
        self._form = form
        self._order = order
        self._days: dict[tuple[str, ...], int] = {}
        self.has_date = has_date(form)
        self.has_time = has_time(form)
        self.period_ns = DAY_NS if "H" in form.groupindex else _HOUR_NS
        """After which times without a date begin anew."""
        self.has_zone = False

    def parse(self, cell: str) -> int:
        """Nanoseconds since 1970 (UTC where the cell has a zone), or since midnight. Raises StampError."""
        found = self._form.fullmatch(cell.strip())
        if found is None:
            raise StampError(cell)
        texts = found.groupdict()
        day = self._day(texts) if self.has_date else 0
        offset_min = _offset_min(texts.get("o"))
        self.has_zone |= bool(texts.get("z") or texts.get("o"))
        return day * DAY_NS + (_time_of_day_ns(texts) if self.has_time else 0) - offset_min * 60 * NS

    def parse_all(self, cells: Sequence[str | bytes]) -> NDArray[np.int64]:
        """Nanoseconds (n,) of cells. Raises StampError."""
        return np.array(
            [self.parse(cell if isinstance(cell, str) else cell.decode("latin-1")) for cell in cells],
            np.int64,
        )

    def parse_matrix(self, cells: NDArray[np.uint8]) -> NDArray[np.int64] | None:
        """Nanoseconds (n,) of ASCII cells of one length (n, length); None where they are not all alike.

        The numbers stand at the same places in all of them, and nothing else differs.
        """
        first = cells[0].tobytes().decode("latin-1")
        found = self._form.fullmatch(first)
        if found is None:
            return None
        spans = {name: found.span(name) for name in _NUMBERS if name in found.re.groupindex and found[name]}
        varying = np.zeros(cells.shape[1], bool)
        for start, end in spans.values():
            varying[start:end] = True
        if (cells[:, ~varying] != cells[0, ~varying]).any():
            return None
        digits = cells[:, varying] - np.uint8(ord("0"))
        if (digits > 9).any():
            return None
        constant = {name: found[name] for name in found.re.groupindex if name not in spans}
        try:
            return self._from_digits(cells, spans, constant)
        except StampError:
            return None  # cell by cell it is named

    def _day(self, texts: dict[str, str | None]) -> int:
        """Days since 1970 of a date. Raises StampError."""
        key = tuple(texts.get(name) or "" for name in "ymdabn")
        if key not in self._days:
            self._days[key] = _days(key, self._order)
        return self._days[key]

    def _from_digits(
        self, cells: NDArray[np.uint8], spans: dict[str, tuple[int, int]], constant: dict[str, str | None]
    ) -> NDArray[np.int64]:
        numbers = {name: _number(cells, span) for name, span in spans.items()}
        total = np.zeros(len(cells), np.int64)
        if self.has_date:
            dates = np.column_stack([numbers[name] for name in "ymdab" if name in numbers])
            changes = np.flatnonzero((np.diff(dates, axis=0) != 0).any(axis=1)) + 1
            for start, end in zip([0, *changes], [*changes, len(cells)], strict=True):
                row = {
                    name: cells[start, slice(*spans[name])].tobytes().decode()
                    for name in "ymdab"
                    if name in spans
                }
                total[start:end] = self._day({**constant, **row}) * DAY_NS
        if self.has_time:
            minutes = numbers["M"]
            hours, seconds = (numbers.get(name, np.zeros_like(minutes)) for name in "HS")
            half = constant.get("p")
            if half:
                hours = hours % 12 + (12 if half in "pP" else 0)
            if (hours > 23).any() or (minutes > 59).any() or (seconds > 60).any():
                raise StampError
            total += ((hours * 60 + minutes) * 60 + seconds) * NS
            if "f" in numbers:
                start, end = spans["f"]
                total += numbers["f"] * 10 ** (9 - (end - start))
        self.has_zone |= bool(constant.get("z") or constant.get("o"))
        return total - _offset_min(constant.get("o")) * 60 * NS


def unwrap_times(times_ns: NDArray[np.int64], period_ns: int = DAY_NS) -> NDArray[np.int64]:
    """Times (n,) in nanoseconds that go on rising where they begin anew after a period, as at midnight."""
    steps = np.diff(times_ns, prepend=times_ns[:1])
    return np.asarray(times_ns + np.cumsum(np.where(steps < -period_ns // 2, period_ns, 0)), np.int64)


def ambiguous_date(path: object, cell: str) -> ImportFileError:
    """Error for dates whose day and month cannot be told apart."""
    return ImportFileError(
        "{path}: in {cell!r} day and month may stand either way. Add {option} dmy or mdy",
        path=path,
        cell=cell,
        option=option("--date-order"),
    )


def no_date_beside(path: object, time: str, date: str) -> ImportFileError:
    """Error for columns that are not times of day and their dates."""
    return ImportFileError(
        "{path}: {option} takes dates beside times of day such as 14:03:00, and {time} and {date}"
        " are not that. Leave it out",
        path=path,
        option=option("--date"),
        time=time,
        date=date,
    )


def to_datetime(since_1970_ns: int, *, has_zone: bool) -> datetime.datetime:
    """Time with zone: UTC, or that of this computer where the stamp has none."""
    naive = datetime.datetime(1970, 1, 1) + datetime.timedelta(microseconds=since_1970_ns // 1000)  # noqa: DTZ001
    return naive.replace(tzinfo=datetime.UTC) if has_zone else naive.astimezone()


def _days(key: tuple[str, ...], order: DateOrder) -> int:
    y, m, d, a, b, n = key
    if a:
        d, m = (a, b) if order == "dmy" else (b, a)
    try:
        month = _MONTHS[n[:3].lower()] if n else int(m)
        year = int(y) + (2000 if len(y) == 2 else 0)
        return (datetime.date(year, month, int(d)) - datetime.date(1970, 1, 1)).days
    except (KeyError, ValueError):
        raise StampError from None


def _time_of_day_ns(texts: dict[str, str | None]) -> int:
    hours, minutes, seconds = (int(texts.get(name) or 0) for name in "HMS")
    if texts.get("p"):
        hours = hours % 12 + (12 if (texts["p"] or "") in "pP" else 0)
    if hours > 23 or minutes > 59 or seconds > 60:
        raise StampError
    fraction = (texts.get("f") or "").ljust(9, "0")
    return ((hours * 60 + minutes) * 60 + seconds) * NS + int(fraction or 0)


def _offset_min(text: str | None) -> int:
    if not text:
        return 0
    minutes = int(text[1:3]) * 60 + int(text[3:].lstrip(":") or 0)
    return -minutes if text[0] == "-" else minutes


def _number(cells: NDArray[np.uint8], span: tuple[int, int]) -> NDArray[np.int64]:
    total = np.zeros(len(cells), np.int64)
    for place in range(*span):
        total = total * 10 + (cells[:, place] - np.uint8(ord("0")))
    return total
