"""Blocks of a report. The template sets each kind; texts are taken literally."""

from typing import Literal

import msgspec


class Symbol(msgspec.Struct, frozen=True, tag="symbol"):
    """A symbol with its subscript, `f_d`, and a unit where it heads a column."""

    text: str
    unit: str = ""


Cell = str | Symbol


class Facts(msgspec.Struct, frozen=True, tag="facts"):
    rows: list[tuple[str, str]]


class Grid(msgspec.Struct, frozen=True, tag="grid"):
    """A table whose header is repeated on every page, in smaller type where `small`.

    The last `numbers` columns hold numbers, set to the right.
    """

    header: list[Cell]
    rows: list[list[Cell]]
    numbers: int = 0
    small: bool = False
    note: str = ""


class Text(msgspec.Struct, frozen=True, tag="text"):
    text: str


class Points(msgspec.Struct, frozen=True, tag="points"):
    texts: list[str]


class Conclusion(msgspec.Struct, frozen=True, tag="verdict"):
    """The result in large type, `symbol relation value`, with its assessment."""

    symbol: Symbol
    value: str
    text: str
    tone: Literal["ok", "warn", "bad"]
    relation: str = "="


class Notice(msgspec.Struct, frozen=True, tag="notice"):
    """An important remark, marked at its side."""

    text: str
    tone: Literal["warn", "bad"] = "bad"


class Drawing(msgspec.Struct, frozen=True, tag="drawing"):
    """A figure as SVG over the full width, with its caption."""

    svg: str
    caption: str


class Drawings(msgspec.Struct, frozen=True, tag="drawings"):
    items: list[Drawing]


class Signatures(msgspec.Struct, frozen=True, tag="signatures"):
    roles: list[str]


Block = Facts | Grid | Text | Points | Conclusion | Notice | Drawing | Drawings | Signatures


class Section(msgspec.Struct, frozen=True):
    """A section of the report; `wide` ones are set on landscape pages."""

    title: str
    blocks: list[Block]
    wide: bool = False


class Logo(msgspec.Struct, frozen=True):
    """Picture of the laboratory that issues a report."""

    format: str  # png, jpg or svg
    data: list[int]  # its bytes, as JSON has them


class Report(msgspec.Struct, frozen=True):
    title: str
    subtitle: str
    head: list[tuple[str, str]]  # number, laboratory, customer, method; without what is unknown
    logo: Logo | None
    number: str  # on every page
    date: str  # ISO date of the report, the only difference between two reports of the same runs
    software: str
    sections: list[Section]
    mark: str = ""  # warning at the head of every page, as SIMULATED
