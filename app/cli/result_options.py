"""Options of commands that identify runs and report results."""

from dataclasses import dataclass
from pathlib import Path

from app.cli import options as opt
from app.cli.errors import CommandError
from app.cli.options import JobOptions

TABLE_FORMATS = ("text", "csv", "json", "markdown", "latex", "xlsx")
FIGURE_FORMATS = ("png", "svg", "pdf")
"""Those of the reports, which are not imported for `--help`."""


@dataclass(frozen=True, kw_only=True)
class AddedMassOptions:
    """Mass that was added to the table between two free decays."""

    added_mass: float | None = opt.number(
        "--added-mass",
        "With --kind one-mass and two runs: mass (kg) that was added to the table in the second.",
        above=0.0,
    )
    added_mass_uncertainty: float = opt.number(
        "--added-mass-uncertainty", "Standard uncertainty of --added-mass (kg).", 0.0, least=0.0
    )

    def check(self, kind: str, runs: int) -> None:
        """Refuse an added mass that does not fit the other options. Raises CommandError."""
        if self.added_mass is not None and (kind != "one-mass" or runs != 2):
            raise CommandError(
                "--added-mass needs --kind one-mass and two runs: the bare table first, then the same with"
                " the added mass"
            )
        if self.added_mass is None and self.added_mass_uncertainty:
            raise CommandError("--added-mass-uncertainty goes with --added-mass. Give that too")


@dataclass(frozen=True, kw_only=True)
class AnalyzeOptions:
    """Identify friction, stiffness and damping of one or more runs."""

    runs: list[Path] = opt.runs_or_folders()
    model: str = opt.option("--model", "Friction law; auto chooses one.", "auto", metavar="[auto|LAW]")
    kind: str = opt.choice(
        "--kind", ("two-mass", "one-mass"), "one-mass for a bare table or any free decay.", "two-mass"
    )
    table_mass: float | None = opt.table_mass()
    plate_mass: float | None = opt.plate_mass()
    monte_carlo: int | None = opt.option(
        "--monte-carlo", "Check the uncertainties by 100,000 draws and N full refits.", metavar="N"
    )
    added: AddedMassOptions
    save: bool = opt.flag("--save", "Keep the result in the run, unless the same is kept and stands.")
    anew: bool = opt.flag("--anew", "With --save: analyse and keep it in any case.")
    figure: Path | None = opt.option(
        "--figure", "Draw record against simulation to this PNG, SVG or PDF (one run)."
    )
    jobs: JobOptions
    force: bool = opt.force()
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """Pool runs to the paper's Table 1, a row a series.

    Below it stands what f_d depends on. A run's newest analysis that is not stale is
    taken, else the run is analysed.
    """

    paths: list[Path] = opt.runs_or_folders()
    format_name: str = opt.choice("--format", TABLE_FORMATS, "Format of the table.", "text")
    published: bool = opt.flag("--published", "Beside the paper's Table 1, with the audit's flags.")
    repeats: bool = opt.flag("--repeats", "Text, Markdown: show how the runs of each series differ.")
    exclude: list[str] | None = opt.exclude()
    save: bool = opt.flag("--save", "Keep new analyses in their runs.")
    output: Path | None = opt.option("-o --output", "File to write; xlsx needs one.")
    jobs: JobOptions
    force: bool = opt.force()
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class FiguresOptions:
    """Draw the paper's figures 2 to 5 from runs, for print.

    2 is f_s and f_d by contact, 3a to 5b are the motion of a run.
    Run files are all drawn; of a folder, the run of a series that is nearest to its mean.
    """

    paths: list[Path] = opt.runs_or_folders()
    output: Path = opt.option("-o --output", "Folder to write to, made if absent.", opt.REQUIRED)
    format_name: str = opt.choice("--format", FIGURE_FORMATS, "Format of the files; png has 300 dpi.", "png")
    series: list[str] | None = opt.option(
        "--series", "Of a folder: draw a run of this series; repeatable. The paper's 1FFM0 if absent."
    )
    figure: list[str] | None = opt.option(
        "--figure", "Only this figure: 2, 3a, 3b, 4a, 4b, 5a or 5b; repeatable."
    )
    jobs: JobOptions
    force: bool = opt.force()
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """Write a test report of one run or a campaign, as PDF.

    It holds results, budgets, figures, warnings and fingerprints.
    The same runs give the same file to the byte, apart from its date.
    """

    paths: list[Path] = opt.runs_or_folders()
    output: Path = opt.option("-o --output", "PDF file to write.", opt.REQUIRED)
    date: str = opt.option("--date", "Date of the report; today if absent.", "", metavar="YYYY-MM-DD")
    title: str = opt.option("--title", "Title of the report.", "")
    laboratory: str = opt.option("--laboratory", "Who issues it.", "")
    exclude: list[str] | None = opt.exclude()
    jobs: JobOptions
    force: bool = opt.force()
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class AuditOptions:
    """Check a published table against itself and the motion.

    Each row is checked for stiffness, damping, velocity, acceleration, breakaway and residual.
    """

    table: Path | None = opt.argument("CSV with Table 1's columns; the paper's if absent.", None)
    as_json: bool = opt.as_json()
