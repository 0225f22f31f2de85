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
from app.reports.figures.plate_figures import ALL_FIGURES, PLATE_FIGURES
from app.reports.figures.run_figures import CAPTION, RunFigureData, contact_names, friction_figure
from app.reports.figures.style import print_style, save_figure
from app.runs.analyze import Progress, repeat_saved_analysis
from app.runs.disk import atomic_write, is_writable, storage_error
from app.runs.errors import RunExistsError, RunNotFoundError
from app.runs.exchange.export_formats import unique_names
from app.runs.validator import Validator
from config.schema import Stand

Format = Literal["png", "svg", "pdf"]
FRICTION_FIGURE = "2"
NUMBERS = (FRICTION_FIGURE, *(one.number for one in ALL_FIGURES))  # the paper's, then those of slips
_OF_SLIPS = tuple(one.number for one in PLATE_FIGURES)


class FigureFile(msgspec.Struct, frozen=True):
    figure: str
    file: str
    caption: str
    run: str = ""  # path of its run; "" for a figure of all runs


class FigureFolder(msgspec.Struct, frozen=True):
    path: str
    format: Format = "png"
    replace: bool = False

    def check(self) -> None:
        path = Path(self.path)
        there = next(place for place in (path, *path.parents) if place.exists())
        if not there.is_dir():
            raise storage_error(path, NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)))
        if not is_writable(there):
            raise storage_error(path, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))

    def check_not_existing(self, stems: Sequence[str], numbers: Iterable[str]) -> None:
        for number in numbers:
            for stem in [""] if number == FRICTION_FIGURE else stems:
                file = self.file(number, stem)
                if file.exists() and not self.replace:
                    raise RunExistsError(
                        "{file} exists already. Choose another folder or add --force", file=file
                    )

    def file(self, number: str, stem: str = "") -> Path:
        """Name of a figure: `fig2.png`, `1FFM0_001-fig3a.png`, `1FFM0_001-fd-time.png`."""
        name = number if number in _OF_SLIPS else f"fig{number}"
        return Path(self.path) / f"{stem}{'-' if stem else ''}{name}.{self.format}"

    def write(
        self, number: str, figure: Figure, caption: str, *, stem: str = "", run: str = ""
    ) -> FigureFile:
        target = self.file(number, stem)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise storage_error(target.parent, error) from None
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
    with print_style(), Validator() as validator:
        if FRICTION_FIGURE in numbers:
            figure = friction_figure(friction_by_contact(campaign.rows), contact_names(stands))
            if figure is None:
                notes.append("no run determined f_s or f_d: Fig. 2 is left out")
            else:
                written.append(folder.write(FRICTION_FIGURE, figure, CAPTION))
        for done, (path, stem) in enumerate(zip(chosen, stems, strict=True)):
            progress(done / len(chosen), path.name)
            analysis, left_out = repeat_saved_analysis(path, validator), []
            run = RunFigureData.from_identification(
                analysis.record, analysis.identification, analysis.run.metadata.unit
            )
            name = analysis.run.metadata.series or path.stem
            for one in ALL_FIGURES:
                if one.number not in numbers:
                    continue
                if (figure := one.render(run)) is None:
                    left_out.append(one.number)
                else:
                    caption = f"{name}. {one.caption}"
                    written.append(folder.write(one.number, figure, caption, stem=stem, run=str(path)))
            for reason, missing in (
                ("no law of motion was fitted", [one for one in left_out if one not in _OF_SLIPS]),
                ("no slips that give friction by themselves", [one for one in left_out if one in _OF_SLIPS]),
            ):
                if missing:
                    notes.append(f"{path.name}: {reason}, Figs. {', '.join(missing)} are left out")
    return written, notes


PAPER_SERIES = "1FFM0"  # Figs. 3 to 5 of the paper show a run of it
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
    by_name, chosen = {run.name: run for run in runs}, []
    for label in dict.fromkeys(wanted):
        row = rows.get(label) or rows.get(label.strip().upper())
        if row is None:
            raise RunNotFoundError(
                "series {label!r} has no run there. Choose from {rows}", label=label, rows=", ".join(rows)
            )
        chosen.append(Path(_nearest(row, by_name)))
    return chosen


def _nearest(row: SeriesRow, runs: dict[str, RunResult]) -> str:
    if _FRICTION not in row.quantities:
        return row.runs[0]
    mean = row.quantities[_FRICTION].quantity.value

    def distance(name: str) -> tuple[bool, float]:
        run = runs[name]
        found = run.results.get(_FRICTION)
        off = float("inf") if found is None else abs(found.value - mean)
        return run.adequate is False and not run.friction_holds, off

    return min(row.runs, key=distance)
