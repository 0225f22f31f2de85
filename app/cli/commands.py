"""The commands and what they are called. Each lives in a module of its own name."""

from typing import Annotated

import typer

from app.cli.analyze import analyze
from app.cli.audit import audit
from app.cli.calibrate import commands as calibrate
from app.cli.demo import demo
from app.cli.device import commands as device
from app.cli.doctor.command import doctor
from app.cli.edit import edit
from app.cli.export import export
from app.cli.figures import figures
from app.cli.health import health
from app.cli.import_record import import_record
from app.cli.plan import plan
from app.cli.record import record
from app.cli.recover import recover
from app.cli.report import report
from app.cli.runs import runs, trash
from app.cli.simulate import simulate
from app.cli.table import table

app = typer.Typer(
    help="Measures dry friction on a shaking stand. "
    "`slipstand` alone opens the window, `slipstand --simulated` opens it on the simulated stand.",
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,
)


_RECORD = "Example: slipstand record --port /dev/ttyUSB0 --protocol csv --series 1FFM0"
_SIMULATE = "Example: slipstand simulate --series 1FFM0 --friction 0.12 -o motion.csv"
_PLAN = "Example: slipstand plan --series 1FFM0 --pullback 0.008 --rate 500"
_IMPORT = (
    "Example: slipstand import test.csv --time t --table u1 --relative u2 --unit mm --series 1FFM0 -o test.h5"
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from app.version import __version__

        typer.echo(f"slipstand {__version__}")
        raise typer.Exit


@app.callback()
def main_options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Hold what stands before the commands."""


app.command()(demo)
app.command(epilog=_RECORD)(record)
app.command()(analyze)
app.command(epilog=_SIMULATE)(simulate)
app.command(epilog=_PLAN)(plan)
app.command("import", epilog=_IMPORT)(import_record)
app.command()(export)
app.command()(table)
app.command()(figures)
app.command()(report)
app.command()(runs)
app.command()(recover)
app.command()(edit)
app.command()(trash)
app.command()(audit)
app.command()(doctor)
app.add_typer(calibrate, name="calibrate")
device.command("health")(health)
app.add_typer(device, name="device")
