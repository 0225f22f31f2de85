"""Content of the campaign's table, its cells, and its text in blocks of columns that fit a terminal."""

import math
import textwrap
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from analysis.campaign.campaign import Campaign, PublishedComparison
from analysis.campaign.contacts import ContactRatio
from analysis.campaign.effects import Effects
from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.rows import STATIC_LOWER, STATIC_UPPER, SeriesRow
from analysis.catalogue import Place, QuantityDefinition, table_columns
from analysis.formatting import (
    NO_BREAK_SPACE,
    format_concise,
    format_fixed,
    format_interval,
    format_signed,
    format_value,
    unbreakable,
    uncertainty_decimals,
)
from analysis.quantities import Quantity, ResultWarning
from app.runs.campaign.collect import CollectedRuns
from app.runs.campaign.origin import CampaignOrigin


@dataclass(frozen=True, slots=True)
class PublishedRowComparison:
    figures: tuple[PublishedComparison, ...]
    flags: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class TableContent:
    campaign: Campaign
    warnings: tuple[ResultWarning, ...] = ()
    failures: tuple[tuple[str, str], ...] = ()
    published: Mapping[str, PublishedRowComparison] | None = field(default=None)
    """By the labels of the rows; None where not asked for."""
    columns: tuple[str, ...] = ()  # optional ones that are shown
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)

    @classmethod
    def of_runs(
        cls,
        runs: CollectedRuns,
        reproduce: str,
        published: Mapping[str, PublishedRowComparison] | None = None,
    ) -> "TableContent":
        """Content of a table or a report of runs, which the command `reproduce` gives again."""
        failures = tuple((failure.run, str(failure.reason)) for failure in runs.failures)
        counted = {run.name: runs.details[run.name] for run in runs.runs if not run.excluded}
        origin = CampaignOrigin.of_runs(counted, reproduce)
        return cls(runs.campaign(), runs.warnings, failures, published, origin=origin)

    def all_warnings(self) -> list[ResultWarning]:
        of_rows = [caution for row in self.campaign.rows for caution in row.warnings]
        return [*self.warnings, *self.campaign.warnings, *of_rows]


def has_inadequate_run(row: SeriesRow) -> bool:
    return any(caution.code == "not-adequate" for caution in row.warnings)


ORIGIN: Final = "Origin"
"""Title of the last of the notes."""
OUTLIER, INADEQUATE, FRICTION_HOLDS = "*", "!", "~"


def table_quantities(optional: Collection[str] = ()) -> tuple[QuantityDefinition, ...]:
    return tuple(row for row, _ in table_columns(optional))


def table_headers(optional: Collection[str] = ()) -> tuple[str, ...]:
    return ("series", "n", *(row.heading(Place.TABLE) for row in table_quantities(optional)))


def row_cells(row: SeriesRow, optional: Collection[str] = ()) -> tuple[str, ...]:
    """Cells of a row, `0.10030(64)`, bounds for f_s without a value, "" where undetermined.

    `*` marks a quantity with an outlier, `!` a series with a run that no law fits, `~` one with
    a run that no law fits, but whose f_d holds.
    """
    holds = any(caution.code == "friction-holds" for caution in row.warnings)
    doubt = INADEQUATE if has_inadequate_run(row) else FRICTION_HOLDS if holds else ""
    values = (_cell(row, column) for column in table_quantities(optional))
    return (row.label + doubt, str(len(row.runs)), *values)


def _cell(row: SeriesRow, column: QuantityDefinition) -> str:
    pooled = row.quantities.get(column.name)
    if pooled is None:
        return _bounds(row) if column.name == "friction_static" else ""
    scale, quantity = column.unit_at(Place.TABLE).scale, pooled.quantity
    shown = format_concise(scale * quantity.value, scale * quantity.standard_uncertainty)
    return shown + (OUTLIER if pooled.outliers else "")


def format_difference(found: Quantity, reference: float, column: QuantityDefinition) -> str:
    """Difference of a quantity from a number, to the digits of its uncertainty: `+0.0012`."""
    scale = column.unit_at(Place.TABLE).scale
    return format_signed(scale * (found.value - reference), _decimals(scale * found.standard_uncertainty))


def repeats(pooled: PooledQuantity) -> str:
    """Scatter of the runs: relative standard deviation and Birge ratio, `0.12 % 1.1`."""
    value = abs(pooled.quantity.value)
    if pooled.scatter is None or pooled.birge_ratio is None or not value:
        return ""
    share = 100.0 * pooled.scatter / value
    mark = OUTLIER if pooled.outliers else ""
    return f"{format_fixed(share, max(0, _decimals(share)))} % {pooled.birge_ratio:.1f}{mark}"


def _decimals(uncertainty: float) -> int:
    return uncertainty_decimals(uncertainty) if 0.0 < uncertainty < math.inf else 6


def _bounds(row: SeriesRow) -> str:
    """`0.130..0.132`; one number where the bounds meet."""
    bounds = [row.quantities.get(name) for name in (STATIC_LOWER, STATIC_UPPER)]
    low, high = (
        one and format_value(one.quantity.value, one.quantity.standard_uncertainty).value for one in bounds
    )
    if low and high:
        return low if float(high) <= float(low) else f"{low}..{high}"
    return f">={low}" if low else f"<={high}" if high else ""


_GAP: Final = "  "
_SAID, _NAMED = 3, 12  # series for which a warning is printed in full, and that are named
LEGEND: Final = (
    "In parentheses: standard uncertainty of the last digits. * a run is far from the others, ! no friction"
    " law explains a run, ~ no model explains a run, but its f_d holds. f_s without parentheses: the"
    " runs only bound it."
)
REPEATS_LEGEND: Final = (
    "Standard deviation of the runs in percent of the mean, and Birge ratio (1: the runs scatter as their"
    " noise predicts)"
)
_PUBLISHED_LEGEND: Final = "Measured minus published, with the published c read as kgf/m:"


def text_lines(content: TableContent, width: int, *, with_repeats: bool = False) -> Iterator[str]:
    """Lines of the table and its notes, of at most `width` characters where words allow it."""
    rows = [row_cells(row, content.columns) for row in content.campaign.rows]
    if warning := content.origin.warning:
        yield from (*_wrapped(warning, width), "")
    yield from blocks(table_headers(content.columns), rows, width)
    yield from ("", *_wrapped(LEGEND, width))
    if with_repeats:
        yield from ("", *_wrapped(f"{REPEATS_LEGEND}:", width), "")
        yield from blocks(*repeats_grid(content), width)
    if content.published is not None:
        yield from ("", *_wrapped(_PUBLISHED_LEGEND, width), "")
        yield from blocks(*published_grid(content), width)
    for title, sentences in note_sections(content):
        yield from ("", title)
        for sentence in sentences:
            is_command = title == ORIGIN and sentence is sentences[-1]  # which is copied from one line
            yield from [f"- {sentence}"] if is_command else _wrapped(sentence, width, "- ")


def note_sections(content: TableContent) -> list[tuple[str, list[str]]]:
    """Notes below the table: titles with sentences; empty ones are left out."""
    campaign, published = content.campaign, content.published or {}
    flags = [f"{label}: {', '.join(row.flags)}" for label, row in published.items() if row.flags]
    every = (
        ("What f_d depends on", effect_sentences(campaign.effects)),
        ("Effects of the stand", [str(effect.message) for effect in campaign.effects_of_stand]),
        ("f_s / f_d by contact", [ratio_sentence(ratio) for ratio in campaign.ratios]),
        ("MSK-64 degrees that the table reached", _degrees(campaign)),
        ("Flags of the audit of the published table", flags),
        ("Runs that do not count", [f"{one.run}: {one.reason}" for one in campaign.excluded]),
        ("Runs without a result", [f"{run}: {reason}" for run, reason in content.failures]),
        ("Warnings", list(_warnings(content))),
        (ORIGIN, list(content.origin.sentences())),
    )
    return [(title, kept) for title, some in every if (kept := [sentence for sentence in some if sentence])]


def _degrees(campaign: Campaign) -> list[str]:
    by_degree = {
        degree: [row.label for row in campaign.rows if row.msk64_degree == degree]
        for degree in campaign.msk64_degrees
    }
    most = max(by_degree, key=lambda degree: len(by_degree[degree]), default="")
    which = "the other" if len(by_degree) > 1 else "all"
    return [
        f"{degree}: {f'{which} {len(labels)} series' if degree == most and labels[1:] else ', '.join(labels)}"
        for degree, labels in by_degree.items()
    ]


def _warnings(content: TableContent) -> Iterator[str]:
    """Warnings. One that many series share is printed for the first, with the names of the others.

    Those of effects of the stand are left out: these are told over all runs.
    """
    told = {effect.name for effect in content.campaign.effects_of_stand}
    of_all = (*content.warnings, *content.campaign.warnings)
    yield from (str(caution.message) for caution in of_all if caution.code not in told)
    by_code: dict[str, list[tuple[str, str]]] = {}
    for row in content.campaign.rows:
        for caution in row.warnings:
            by_code.setdefault(caution.code, []).append((row.label, str(caution.message)))
    for same in by_code.values():
        if len(same) <= _SAID:
            yield from (message for _, message in same)
        else:
            first, others = same[0][1].rstrip("."), [label for label, _ in same[1:]]
            more = "" if len(others) <= _NAMED else f" and {len(others) - _NAMED} more"
            names = ", ".join(others[:_NAMED]) + more
            yield f"{first}. The same applies to {len(others)} other series: {names}"


def effect_sentences(effects: Effects) -> list[str]:
    """One sentence for each cause, and the scatter of the series about the model."""
    sentences = [str(effect.sentence) for effect in effects.effects]
    if effects.scatter:
        sentences.append(
            f"The {effects.series} series scatter about this by {100.0 * effects.scatter:.2g} % beyond their"
            " uncertainties; the tests include this scatter."
        )
    return sentences


def ratio_sentence(ratio: ContactRatio) -> str:
    contact = ratio.contact or "contact not named"
    low, high = ratio.bounds
    parts = []
    if ratio.ratio is not None:
        number = format_concise(ratio.ratio.value, ratio.ratio.standard_uncertainty)
        ends = format_interval(*ratio.ratio.interval_95)
        between = ratio.between_series
        spread = "" if between is None else f" with a standard deviation of {between:.2g}"
        parts.append(f"{number} (95 %: {ends}) over {ratio.series} series{spread}")
    if low is not None and high is not None:
        parts.append(f"between {low:.3f} and {high:.3f} where the runs only bound f_s")
    elif low is not None:
        parts.append(f"at least {low:.3f} where the runs only bound f_s from below")
    return f"{contact}: {', '.join(parts) or 'not determined'}"


def repeats_grid(content: TableContent) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    columns, rows = table_quantities(content.columns)[1:], []
    for row in content.campaign.rows:
        cells = (repeats(row.quantities[one.name]) if one.name in row.quantities else "" for one in columns)
        rows.append((row.label, *cells))
    return ("series", *(column.symbol.text for column in columns)), rows


def published_grid(content: TableContent) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Differences from the published table: header and rows."""
    rows, published = [], content.published or {}
    for row in content.campaign.rows:
        if row.label in published:
            printed = {one.name: one.published for one in published[row.label].figures}
            cells = (
                format_difference(row.quantities[one.name].quantity, printed[one.name], one)
                if one.name in printed
                else ""
                for one in table_quantities()[1:]
            )
            rows.append((row.label, *cells))
    return ("series", *table_headers()[3:]), rows


def blocks(header: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> Iterator[str]:
    """Lines of a table, split into blocks of columns that fit `width`; each begins with the first column."""
    widths = [max(len(row[place]) for row in (header, *rows)) for place in range(len(header))]
    for number, places in enumerate(_fitting(widths, width)):
        if number:
            yield ""
        for row in (header, *rows):
            yield _GAP.join(row[place].ljust(widths[place]) for place in places).rstrip()


def _fitting(widths: Sequence[int], width: int) -> Iterator[list[int]]:
    block, used = [0], widths[0]
    for place, wide in enumerate(widths[1:], start=1):
        if len(block) > 1 and used + len(_GAP) + wide > width:
            yield block
            block, used = [0], widths[0]
        block.append(place)
        used += len(_GAP) + wide
    yield block


def _wrapped(text: str, width: int, begin: str = "") -> list[str]:
    """Lines of a sentence, of which none ends inside a value."""
    wrapper = textwrap.TextWrapper(
        width, begin, " " * len(begin), break_long_words=False, break_on_hyphens=False
    )
    return [line.replace(NO_BREAK_SPACE, " ") for line in wrapper.wrap(unbreakable(text))]
