"""The commands of `slipstand`. A command's module is imported when the command runs."""

from importlib import import_module
from typing import Annotated, Any, ClassVar, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from app.cli.options import command_function
from app.log import start_log
from app.version import __version__


class CommandEntry(NamedTuple):
    """A command before its modules are imported."""

    name: str
    options: str
    """Module and class of its options, imported when the command is named: "library_options:Runs"."""
    target: str
    """Module and function that does the work, imported when the command runs."""
    summary: str
    """First line of the help, for the list of commands."""
    example: str = ""
    """Shown below the help."""
    group: type[TyperGroup] | None = None
    """Group of the commands below this one."""

    def load(self) -> Any:
        """Import the options, and return the Click command."""
        function = command_function(_load(self.options), self._run)
        commands = _typer()
        if self.group:
            commands.callback(cls=self.group, invoke_without_command=True)(function)
        else:
            commands.command(self.name, epilog=self.example or None)(function)
        command = typer.main.get_command(commands)
        command.name = self.name
        return command

    def _run(self, options: Any) -> None:
        _load(self.target)(options)


def _load(target: str) -> Any:
    module, _, name = target.partition(":")
    return getattr(import_module(f"app.cli.{module}"), name)


class LazyGroup(TyperGroup):
    """A group that lists its commands without importing them."""

    entries: ClassVar[tuple[CommandEntry, ...]] = ()

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        groups, self.commands = self.commands, {}
        for entry in self.entries:
            self.add_command(TyperCommand(entry.name, help=entry.summary))
        self.commands |= groups
        self._entries = {entry.name: entry for entry in self.entries}

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return name, command and remaining arguments, with the command's module imported."""
        name, command, rest = super().resolve_command(ctx, args)
        entry = self._entries.get(name or "")
        return name, entry.load() if entry else command, rest


class CalibrateGroup(LazyGroup):
    """Commands of `slipstand calibrate`."""

    entries = (
        CommandEntry(
            "check",
            "device_options:CheckOptions",
            "calibration_check:check",
            "Check a gauge by a known displacement or its shunt.",
        ),
    )


class SlipstandGroup(LazyGroup):
    """Commands of `slipstand`."""

    entries = (
        CommandEntry(
            "demo",
            "measurement_options:DemoOptions",
            "demo:demo",
            "Record a simulated pullback, and compare it with the truth.",
        ),
        CommandEntry(
            "record",
            "measurement_options:RecordOptions",
            "record:record",
            "Record a pullback test from a device into a run file.",
            "Example: slipstand record --port /dev/ttyUSB0 --protocol csv --series 1FFM0",
        ),
        CommandEntry(
            "analyze",
            "result_options:AnalyzeOptions",
            "analyze:analyze",
            "Identify friction, stiffness and damping of one or more runs.",
        ),
        CommandEntry(
            "simulate",
            "measurement_options:SimulateOptions",
            "simulate:simulate",
            "Simulate one pullback test: numbers, a CSV file or a run.",
            "Example: slipstand simulate --series 1FFM0 --friction 0.12 -o motion.csv",
        ),
        CommandEntry(
            "plan",
            "measurement_options:PlanOptions",
            "plan:plan",
            "Predict what a test will show, before it is made.",
            "Example: slipstand plan --series 1FFM0 --pullback 0.008 --rate 500",
        ),
        CommandEntry(
            "import",
            "library_options:ImportOptions",
            "import_record:import_record",
            "Make a run of a CSV, .mat, .xlsx or .parquet file.",
            "Example: slipstand import test.csv --time t --table u1 --relative u2 --unit mm --series 1FFM0"
            " -o test.h5",
        ),
        CommandEntry(
            "export",
            "library_options:ExportOptions",
            "export:export",
            "Write samples and coefficients of runs for other programs.",
        ),
        CommandEntry(
            "table",
            "result_options:TableOptions",
            "table:table",
            "Pool runs to the paper's Table 1, a row a series.",
        ),
        CommandEntry(
            "figures",
            "result_options:FiguresOptions",
            "figures:figures",
            "Draw the paper's figures 2 to 5 from runs, for print.",
        ),
        CommandEntry(
            "report",
            "result_options:ReportOptions",
            "report:report",
            "Write a test report of one run or a campaign, as PDF.",
        ),
        CommandEntry(
            "runs", "library_options:ListRunsOptions", "runs:runs", "List recorded runs, oldest first."
        ),
        CommandEntry(
            "recover",
            "library_options:RecoverOptions",
            "recover:recover",
            "Rebuild runs that a crash cut short, from their journals.",
        ),
        CommandEntry(
            "edit",
            "library_options:EditOptions",
            "edit:edit",
            "Change what is known of runs, kept as history.",
        ),
        CommandEntry(
            "trash",
            "library_options:TrashOptions",
            "runs:trash",
            "Move runs to the trash, and bring them back.",
        ),
        CommandEntry(
            "audit",
            "result_options:AuditOptions",
            "audit:audit",
            "Check a published table against itself and the motion.",
        ),
        CommandEntry(
            "doctor",
            "library_options:DoctorOptions",
            "doctor.command:doctor",
            "Check installation, settings, gauges, ports and clocks.",
        ),
        CommandEntry(
            "calibrate",
            "device_options:CalibrateOptions",
            "calibrate:calibrate",
            "Calibrate a gauge against a dial: live, or from a file.",
            group=CalibrateGroup,
        ),
    )


class DeviceGroup(LazyGroup):
    """Commands of `slipstand device`."""

    entries = (
        CommandEntry(
            "list",
            "device_options:ListDevicesOptions",
            "device:list_devices",
            "List the protocols, and what each was verified against.",
        ),
        CommandEntry(
            "ports",
            "device_options:ListPortsOptions",
            "device:list_ports",
            "List the serial ports of this computer.",
        ),
        CommandEntry(
            "probe",
            "device_options:ProbeOptions",
            "device:probe",
            "Look at ports: what speaks on them, how to record it.",
        ),
        CommandEntry(
            "simulate",
            "device_options:SimulateDeviceOptions",
            "simulate_device:simulate_device",
            "Be a simulated stand on a port until interrupted.",
        ),
        CommandEntry(
            "health",
            "device_options:HealthOptions",
            "health:health",
            "Look at both gauges at rest: noise, drift, hum, range.",
        ),
    )


def _typer(**settings: Any) -> typer.Typer:
    return typer.Typer(
        pretty_exceptions_enable=False, add_completion=False, rich_markup_mode=None, **settings
    )


app = _typer(
    cls=SlipstandGroup,
    help="Measures dry friction on a shaking stand. "
    "`slipstand` alone opens the window, `slipstand --simulated` opens it on the simulated stand.",
)
app.add_typer(
    _typer(cls=DeviceGroup, help="Devices, ports and the simulated stand.", no_args_is_help=True),
    name="device",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"slipstand {__version__}")
        raise typer.Exit


@app.callback()
def main_options(
    version: Annotated[  # noqa: ARG001 - its callback shows it
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Write the log in detail, and to stderr as well.")
    ] = False,
) -> None:
    """Hold the options that stand before the command."""
    if verbose:
        start_log("command", "debug", on_stderr=True)
