"""Options of commands that identify runs and report results."""

from dataclasses import dataclass
from pathlib import Path

from app.cli import shared_options as shared
from app.cli.errors import CommandError, alternatives
from app.cli.options import REQUIRED, argument, choice, completion, flag, number, option
from app.cli.shared_options import JobOptions
from app.reports.table.formats import FORMATS as TABLE_FORMATS

FIGURE_FORMATS = ("png", "svg", "pdf")
FIGURES = ("2", "3a", "3b", "4a", "4b", "5a", "5b", "fd-velocity", "fd-position", "fd-time")
"""Those of the reports, which are not imported for `--help`."""


@dataclass(frozen=True, kw_only=True)
class SpanOptions:
    """Which part of a record is analysed."""

    from_s: float | None = number("--from", "First time of the record that is analysed (s).")
    until_s: float | None = number("--until", "Last time of the record that is analysed (s).")
    release: int | None = number(
        "--release",
        "Which release of the record, from 1; the one with the longest decay if absent.",
        least=1,
        integer=True,
    )

    def check(self, kind: str) -> None:
        """Refuse a span without an inside, and releases of one mass. Raises CommandError."""
        if self.from_s is not None and self.until_s is not None and self.from_s >= self.until_s:
            raise CommandError(f"--from {self.from_s:g} is not before --until {self.until_s:g}. Swap them")
        if self.release is not None and kind == "one-mass":
            raise CommandError("--release is for two masses. Choose the decay of one by --from and --until")


@dataclass(frozen=True, kw_only=True)
class AddedMassOptions:
    """Mass that was added to the table, in one free decay or between two."""

    added_mass: float | None = number(
        "--added-mass",
        "With --kind one-mass: mass (kg) added to the table, in the second of two runs, which give its own.",
        above=0.0,
    )
    added_mass_uncertainty: float = number(
        "--added-mass-uncertainty", "Standard uncertainty of --added-mass (kg).", 0.0, least=0.0
    )

    def check(self, kind: str, runs: int) -> None:
        """Refuse an added mass that does not fit the other options. Raises CommandError."""
        if self.added_mass is not None and (kind != "one-mass" or runs > 2):
            raise CommandError(
                "--added-mass needs --kind one-mass and one run with that mass, or two runs: the bare table"
                " first, then the same with the added mass"
            )
        if self.added_mass is None and self.added_mass_uncertainty:
            raise CommandError("--added-mass-uncertainty goes with --added-mass. Give that too")


@dataclass(frozen=True, kw_only=True)
class AnalyzeOptions:
    """Identify friction, stiffness and damping of one or more runs."""

    runs: list[Path] = shared.runs_or_folders()
    model: str = option(
        "--model", "auto chooses a friction law; an unknown one lists all.", "auto", metavar="LAW"
    )
    kind: str = choice(
        "--kind", ("two-mass", "one-mass"), "one-mass for a bare table or any free decay.", "two-mass"
    )
    table_mass: float | None = shared.table_mass()
    plate_mass: float | None = shared.plate_mass()
    monte_carlo: int | None = option(
        "--monte-carlo", "Check the uncertainties by 100,000 draws and N full refits.", metavar="N"
    )
    span: SpanOptions
    added: AddedMassOptions
    save: bool = flag("--save", "Keep the result in the run, unless the same is kept already.")
    anew: bool = flag("--anew", "With --save: analyse and keep the result in any case.")
    only_new: bool = flag("--only-new", "Leave out runs of a folder that hold a valid result.")
    figure: Path | None = option("--figure", "Draw record and simulation: PNG, SVG or PDF, of one run.")
    jobs: JobOptions
    force: bool = shared.force()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """Pool runs to the paper's Table 1, a row a series.

    Below it stands what f_d depends on. A run's newest analysis that is not stale is
    taken, else the run is analysed.
    """

    paths: list[Path] = shared.runs_or_folders()
    format_name: str | None = choice(
        "--format", TABLE_FORMATS, "Format of the table; by the ending of -o if absent, else text."
    )
    published: bool = flag("--published", "Beside the paper's Table 1, with the audit's flags.")
    repeats: bool = flag("--repeats", "Text, Markdown: show how the runs of each series differ.")
    column: list[str] | None = option(
        "--column",
        "Also this column: friction_dynamic_plate, f_d from the plate alone; repeatable.",
        autocompletion=completion(("friction_dynamic_plate",)),
    )
    exclude: list[str] | None = shared.exclude()
    save: bool = flag("--save", "Keep new analyses in their runs.")
    output: Path | None = option("-o --output", "File to write; xlsx needs one.")
    jobs: JobOptions
    force: bool = shared.force()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class FiguresOptions:
    """Draw the paper's figures 2 to 5, and friction by slip.

    2 is f_s and f_d by contact, 3a to 5b are the motion of a run, fd-... the friction of its slips.
    Run files are all drawn; of a folder, the run of a series that is nearest to its mean.
    """

    paths: list[Path] = shared.runs_or_folders()
    output: Path = option("-o --output", "Folder to write to, made if absent.", REQUIRED)
    format_name: str = choice("--format", FIGURE_FORMATS, "Format of the files; png has 300 dpi.", "png")
    series: list[str] | None = option(
        "--series",
        "Of a folder: draw a run of this series; repeatable. The paper's 1FFM0 if absent.",
        autocompletion=completion(shared.series_codes),
    )
    figure: list[str] | None = option(
        "--figure",
        f"Only this figure: {alternatives(FIGURES)}; repeatable.",
        autocompletion=completion(FIGURES),
        metavar="FIGURE",
    )
    jobs: JobOptions
    force: bool = shared.force()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """Write a test report of one run or a campaign, as PDF.

    It holds results, budgets, figures, warnings and fingerprints.
    The same runs give the same file to the byte, apart from its date.
    """

    paths: list[Path] = shared.runs_or_folders()
    output: Path = option("-o --output", "PDF file to write.", REQUIRED)
    date: str = option("--date", "Date of the report; today if absent.", "", metavar="DATE")
    title: str = option("--title", "Title of the report.", "")
    laboratory: str = option("--laboratory", "Who issues it; as in settings.toml if absent.", "")
    customer: str = option("--customer", "Whom it is for.", "")
    number: str = option("--number", "Number of the report; of its date and inputs if absent.", "")
    method: str = option("--method", "Method of test with its reference; the paper's if absent.", "")
    exclude: list[str] | None = shared.exclude()
    jobs: JobOptions
    force: bool = shared.force()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class AuditOptions:
    """Check a published table against itself and the motion.

    Each row is checked for stiffness, damping, velocity, acceleration, breakaway and residual.
    """

    table: Path | None = argument(
        "CSV with Table 1's columns; the paper's if absent.", None, metavar="TABLE.csv"
    )
    as_json: bool = shared.as_json()
