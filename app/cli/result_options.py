"""Options of commands that identify runs and report results."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from app.cli.errors import CommandError
from app.cli.options import (
    Exclude,
    Force,
    JobOptions,
    Json,
    PlateMass,
    RunsOrFolders,
    TableMass,
    choice,
    number,
)

TABLE_FORMATS = ("text", "csv", "json", "markdown", "latex", "xlsx")
FIGURE_FORMATS = ("png", "svg", "pdf")
"""Those of the reports, which are not imported for `--help`."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class AddedMassOptions:
    """Mass that was added to the table between two free decays."""

    added_mass: Annotated[
        float | None,
        number(
            "--added-mass",
            above=0.0,
            help="With --kind one-mass and two runs: mass (kg) that was added to the table in the second.",
        ),
    ] = None
    added_mass_uncertainty: Annotated[
        float,
        number("--added-mass-uncertainty", least=0.0, help="Standard uncertainty of --added-mass (kg)."),
    ] = 0.0

    def check(self, kind: str, runs: int) -> None:
        """Refuse an added mass that does not fit the other options. Raises CommandError."""
        if self.added_mass is not None and (kind != "one-mass" or runs != 2):
            raise CommandError(
                "--added-mass needs --kind one-mass and two runs: the bare table first, then the same with"
                " the added mass"
            )
        if self.added_mass is None and self.added_mass_uncertainty:
            raise CommandError("--added-mass-uncertainty goes with --added-mass. Give that too")


@dataclasses.dataclass(frozen=True, kw_only=True)
class AnalyzeOptions:
    """Identify friction, stiffness and damping of one or more runs."""

    runs: RunsOrFolders
    model: Annotated[
        str, typer.Option("--model", metavar="[auto|LAW]", help="Friction law; auto chooses one.")
    ] = "auto"
    kind: Annotated[
        str,
        choice("--kind", "two-mass", "one-mass", help="one-mass for a bare table or any free decay."),
    ] = "two-mass"
    table_mass: TableMass = None
    plate_mass: PlateMass = None
    monte_carlo: Annotated[
        int | None,
        typer.Option(metavar="N", help="Check the uncertainties by 100,000 draws and N full refits."),
    ] = None
    added: AddedMassOptions
    save: Annotated[
        bool, typer.Option("--save", help="Keep the result in the run, unless the same is kept and stands.")
    ] = False
    anew: Annotated[bool, typer.Option("--anew", help="With --save: analyse and keep it in any case.")] = (
        False
    )
    figure: Annotated[
        Path | None, typer.Option(help="Draw record against simulation to this PNG, SVG or PDF (one run).")
    ] = None
    jobs: JobOptions
    force: Force = False
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class TableOptions:
    """Pool runs to the paper's Table 1, a row a series.

    Below it stands what f_d depends on. A run's newest analysis that is not stale is
    taken, else the run is analysed.
    """

    paths: RunsOrFolders
    format_name: Annotated[str, choice("--format", *TABLE_FORMATS, help="Format of the table.")] = "text"
    published: Annotated[
        bool, typer.Option("--published", help="Beside the paper's Table 1, with the audit's flags.")
    ] = False
    repeats: Annotated[
        bool, typer.Option("--repeats", help="Text, Markdown: show how the runs of each series differ.")
    ] = False
    exclude: Exclude = None
    save: Annotated[bool, typer.Option("--save", help="Keep new analyses in their runs.")] = False
    output: Annotated[Path | None, typer.Option("-o", "--output", help="File to write; xlsx needs one.")] = (
        None
    )
    jobs: JobOptions
    force: Force = False
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class FiguresOptions:
    """Draw the paper's figures 2 to 5 from runs, for print.

    2 is f_s and f_d by contact, 3a to 5b are the motion of a run.
    Run files are all drawn; of a folder, the run of a series that is nearest to its mean.
    """

    paths: RunsOrFolders
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to, made if absent.")]
    format_name: Annotated[
        str, choice("--format", *FIGURE_FORMATS, help="Format of the files; png has 300 dpi.")
    ] = "png"
    series: Annotated[
        list[str] | None,
        typer.Option(help="Of a folder: draw a run of this series; repeatable. The paper's 1FFM0 if absent."),
    ] = None
    figure: Annotated[
        list[str] | None, typer.Option(help="Only this figure: 2, 3a, 3b, 4a, 4b, 5a or 5b; repeatable.")
    ] = None
    jobs: JobOptions
    force: Force = False
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """Write a test report of one run or a campaign, as PDF.

    It holds results, budgets, figures, warnings and fingerprints.
    The same runs give the same file to the byte, apart from its date.
    """

    paths: RunsOrFolders
    output: Annotated[Path, typer.Option("-o", "--output", help="PDF file to write.")]
    date: Annotated[str, typer.Option(metavar="YYYY-MM-DD", help="Date of the report; today if absent.")] = ""
    title: Annotated[str, typer.Option(help="Title of the report.")] = ""
    laboratory: Annotated[str, typer.Option(help="Who issues it.")] = ""
    exclude: Exclude = None
    jobs: JobOptions
    force: Force = False
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class AuditOptions:
    """Check a published table against itself and the motion.

    Each row is checked for stiffness, damping, velocity, acceleration, breakaway and residual.
    """

    table: Annotated[
        Path | None, typer.Argument(help="CSV with Table 1's columns; the paper's if absent.")
    ] = None
    as_json: Json = False
