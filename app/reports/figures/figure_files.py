"""Writing of the paper's figures to a folder, atomically, without overwriting unless asked."""

import errno
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

import msgspec
from matplotlib.figure import Figure

from analysis.campaign.campaign import Campaign
from analysis.campaign.contacts import friction_by_contact
from analysis.campaign.rows import SeriesRow
from analysis.campaign.series import RunResult
from app.reports.figures.friction_figure import CAPTION, contact_names, friction_figure
from app.reports.figures.run_figures import RUN_FIGURES, RunFigureData
from app.reports.figures.style import print_style, save_figure
from app.runs.analyze import Analysis, Progress, repeat_saved_analysis
from app.runs.disk import atomic_write, storage_error
from app.runs.errors import RunExistsError, RunNotFoundError
from app.runs.exchange.exporting import unique_names
from app.runs.validator import Validator
from config.schema import Stand

Format = Literal["png", "svg", "pdf"]
FRICTION_FIGURE = "2"
NUMBERS = (FRICTION_FIGURE, *(one.number for one in RUN_FIGURES))
"""Numbers of the paper's figures that are drawn."""


class FigureFile(msgspec.Struct, frozen=True):
    """A written figure."""

    figure: str
    file: str
    caption: str
    run: str = ""
    """Path of its run; "" for a figure of all runs."""


class FigureFolder(msgspec.Struct, frozen=True):
    """Folder and format of figures."""

    path: str
    format: Format = "png"
    replace: bool = False

    def check(self) -> None:
        path = Path(self.path)
        there = next(place for place in (path, *path.parents) if place.exists())
        if not there.is_dir():
            raise storage_error(path, NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)))
        if not os.access(there, os.W_OK):
            raise storage_error(path, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))

    def create(self) -> None:
        try:
            Path(self.path).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise storage_error(Path(self.path), error) from None

    def check_not_existing(self, stems: Sequence[str], numbers: Iterable[str]) -> None:
        for number in numbers:
            for stem in [""] if number == FRICTION_FIGURE else stems:
                file = self.file(number, stem)
                if file.exists() and not self.replace:
                    raise RunExistsError(
                        "{file} exists already. Choose another folder or add --force", file=file
                    )

    def file(self, number: str, stem: str = "") -> Path:
        """Name of a figure: `fig2.png`, `1FFM0_001-fig3a.png`."""
        return Path(self.path) / f"{stem}{'-' if stem else ''}fig{number}.{self.format}"

    def write(
        self, number: str, figure: Figure, caption: str, *, stem: str = "", run: str = ""
    ) -> FigureFile:
        self.create()
        target = self.file(number, stem)
        with atomic_write(target, replace=self.replace) as made:
            save_figure(figure, made)
        return FigureFile(number, str(target), caption, run)


def write_figures(
    folder: FigureFolder,
    numbers: Sequence[str],
    chosen: Sequence[Path],
    campaign: Campaign,
    stands: Iterable[Stand],
    progress: Progress,
) -> tuple[list[FigureFile], list[str]]:
    """Write Fig. 2 of a campaign on these stands and the others of the runs `chosen`, as far as wanted.

    `progress` is called with the share done and the name of the run that is drawn. Returns the figures, and
    a sentence for each figure that could not be drawn. Raises RunError if a name is taken, a run cannot be
    read, or the folder takes no files.
    """
    stems = unique_names(path.stem for path in chosen)
    folder.check_not_existing(stems, numbers)
    written, notes = [], []
    if FRICTION_FIGURE in numbers:
        of_all = write_friction_figure(folder, campaign, stands)
        written += [of_all] if of_all else []
        notes += [] if of_all else ["no run determined f_s or f_d: Fig. 2 is left out"]
    with Validator() as validator:
        for done, (path, stem) in enumerate(zip(chosen, stems, strict=True)):
            progress(done / len(chosen), path.name)
            drawn, left_out = write_run_figures(folder, repeat_saved_analysis(path, validator), stem, numbers)
            written += drawn
            if left_out:
                figures = ", ".join(left_out)
                notes.append(f"{path.name}: no law of motion was fitted, Figs. {figures} are left out")
    return written, notes


def write_friction_figure(
    folder: FigureFolder, campaign: Campaign, stands: Iterable[Stand]
) -> FigureFile | None:
    """Write Fig. 2 of a campaign on these stands; None without a friction coefficient. Raises RunError."""
    with print_style():
        figure = friction_figure(friction_by_contact(campaign.rows), contact_names(stands))
        return None if figure is None else folder.write(FRICTION_FIGURE, figure, CAPTION)


def write_run_figures(
    folder: FigureFolder, analysis: Analysis, stem: str, numbers: Iterable[str]
) -> tuple[list[FigureFile], list[str]]:
    """Write Figs. 3a to 5b as far as wanted; returns the figures, and the numbers that need a fitted law."""
    drawn = RunFigureData.from_identification(analysis.record, analysis.identification)
    run = analysis.run.metadata.series or analysis.run.path.stem
    written, left_out = [], []
    with print_style():
        for one in RUN_FIGURES:
            if one.number not in numbers:
                continue
            figure = one.render(drawn)
            if figure is None:
                left_out.append(one.number)
                continue
            caption = f"{run}. {one.caption}"
            written.append(folder.write(one.number, figure, caption, stem=stem, run=str(analysis.run.path)))
    return written, left_out


PAPER_SERIES = "1FFM0"
"""Figs. 3 to 5 of the paper show a run of it."""
_FRICTION = "friction_dynamic"


def representative_runs(
    campaign: Campaign, runs: Sequence[RunResult], wanted: Sequence[str] = ()
) -> list[Path]:
    """One run of each wanted series; by default of the paper's, or else of the first with f_d.

    It is the run whose f_d lies nearest to that of its series, among those that a friction law explains.
    Raises RunNotFoundError for a series without a run.
    """
    rows = {row.label: row for row in campaign.rows}
    if not wanted:
        known = [label for label, row in rows.items() if _FRICTION in row.quantities] or list(rows)
        wanted = [PAPER_SERIES] if PAPER_SERIES in known else known[:1]
    by_name = {run.name: run for run in runs}
    return [Path(_nearest(_row(rows, label), by_name)) for label in dict.fromkeys(wanted)]


def _row(rows: dict[str, SeriesRow], label: str) -> SeriesRow:
    row = rows.get(label) or rows.get(label.strip().upper())
    if row is None:
        raise RunNotFoundError(
            "series {label!r} has no run there. Choose from {rows}", label=label, rows=", ".join(rows)
        )
    return row


def _nearest(row: SeriesRow, runs: dict[str, RunResult]) -> str:
    if _FRICTION not in row.quantities:
        return row.runs[0]
    mean = row.quantities[_FRICTION].quantity.value

    def distance(name: str) -> tuple[bool, float]:
        run = runs[name]
        found = run.results.get(_FRICTION)
        return run.adequate is False, float("inf") if found is None else abs(found.value - mean)

    return min(row.runs, key=distance)
