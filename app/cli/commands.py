"""The commands of `slipstand`. A command's module is imported when the command runs."""

from importlib import import_module
from typing import Annotated, Any, ClassVar, Final, NamedTuple

import typer
from typer.core import TyperArgument, TyperGroup

from app.cli.options import command_function
from app.log import start_log
from app.version import version_text

_EXAMPLES: Final = {
    "demo:demo": "demo --series 1SSM1 --friction 0.13",
    "record:record": "record --port /dev/ttyUSB0 --protocol csv --series 1FFM0",
    "analyze:analyze": "analyze recordings --save",
    "simulate:simulate": "simulate --series 1FFM0 --friction 0.12 -o motion.csv",
    "plan:plan": "plan --series 1FFM0 --pullback 0.008 --rate 500",
    "import_record:import_record": "import test.csv --time t --table u1 --relative u2 --unit mm"
    " --series 1FFM0 -o test.h5",
    "watch:watch": "watch incoming --time t --table u1 --relative u2 --unit mm --series 1FFM0"
    " --write-table table.xlsx",
    "export:export": "export recordings --content coefficients -o results.xlsx",
    "table:table": "table recordings --format csv -o table.csv",
    "figures:figures": "figures recordings --format pdf -o figures",
    "report:report": 'report recordings --laboratory "Institute of Mechanics" -o report.pdf',
    "runs:runs": "runs --series 1FFM0 --since 2026-11-21 --sort f_d",
    "recover:recover": "recover recordings",
    "edit:edit": "edit run.h5 --plate-mass 22.5 --condition plate_id=P1",
    "runs:trash": "trash run.h5",
    "audit:audit": "audit table.csv",
    "doctor:doctor": "doctor --bundle findings.zip",
    "calibrate:calibrate": "calibrate --gauge table --points readings.csv --dial-uncertainty 0.003",
    "calibration_check:check": "calibrate check --gauge table --port /dev/ttyUSB0 --protocol csv"
    " --displacement 10 --uncertainty 0.002",
    "device:list_devices": "device list",
    "device:list_ports": "device ports",
    "device:probe": "device probe /dev/ttyUSB0 --write",
    "simulate_device:simulate_device": "device simulate --protocol gsv --series 1FFM0 --tcp 5000",
    "health:health": "device health --port /dev/ttyUSB0 --protocol csv",
}
"""Shown below the help of a command, by its target."""


class _Argument(TyperArgument):
    """An argument that is shown by what is to be given alone: `RUN`, without braces and a Python type."""

    def get_usage_pieces(self, ctx: Any) -> list[str]:  # noqa: ARG002 - as Click calls it
        return [f"{self.metavar if self.required else f'[{self.metavar}]'}{'...' if self.nargs != 1 else ''}"]

    def get_help_record(self, ctx: Any) -> tuple[str, str] | None:
        record = super().get_help_record(ctx)
        return record and (str(self.metavar), record[1])


class CommandEntry(NamedTuple):
    """A command before its modules are imported."""

    name: str
    options: str
    """Module and class of its options, imported when the command is named: "run_file_options:Runs"."""
    target: str  # module and function that does the work, imported when the command runs
    group: type[TyperGroup] | None = None  # group of the commands below this one

    def load(self) -> Any:
        example = f"\b\nExample: slipstand {_EXAMPLES[self.target]}"  # \b: it is not wrapped
        function = command_function(_load(self.options), self._run)
        commands = _typer()
        if self.group:
            commands.callback(cls=self.group, invoke_without_command=True, epilog=example)(function)
        else:
            commands.command(self.name, epilog=example)(function)
        command = typer.main.get_command(commands)
        command.name = self.name
        for param in command.params:
            if isinstance(param, TyperArgument):
                param.__class__ = _Argument
        return command

    def _run(self, options: Any) -> None:
        _load(self.target)(options)


def _load(target: str) -> Any:
    module, _, name = target.partition(":")
    return getattr(import_module(f"app.cli.{module}"), name)


class LazyGroup(TyperGroup):
    """A group of commands whose options are imported when they are needed."""

    entries: ClassVar[tuple[CommandEntry, ...]] = ()

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - as Click calls it
        return [*(entry.name for entry in self.entries), *self.commands]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        for entry in self.entries:
            if entry.name == cmd_name:
                return entry.load()
        return super().get_command(ctx, cmd_name)


class CalibrateGroup(LazyGroup):
    """Commands of `slipstand calibrate`."""

    entries = (CommandEntry("check", "device_options:CheckOptions", "calibration_check:check"),)


class SlipstandGroup(LazyGroup):
    """Commands of `slipstand`."""

    entries = (
        CommandEntry("demo", "measurement_options:DemoOptions", "demo:demo"),
        CommandEntry("record", "measurement_options:RecordOptions", "record:record"),
        CommandEntry("analyze", "result_options:AnalyzeOptions", "analyze:analyze"),
        CommandEntry("simulate", "measurement_options:SimulateOptions", "simulate:simulate"),
        CommandEntry("plan", "measurement_options:PlanOptions", "plan:plan"),
        CommandEntry("import", "run_file_options:ImportOptions", "import_record:import_record"),
        CommandEntry("watch", "run_file_options:WatchOptions", "watch:watch"),
        CommandEntry("export", "run_file_options:ExportOptions", "export:export"),
        CommandEntry("table", "result_options:TableOptions", "table:table"),
        CommandEntry("figures", "result_options:FiguresOptions", "figures:figures"),
        CommandEntry("report", "result_options:ReportOptions", "report:report"),
        CommandEntry("runs", "run_file_options:ListRunsOptions", "runs:runs"),
        CommandEntry("recover", "run_file_options:RecoverOptions", "recover:recover"),
        CommandEntry("edit", "run_file_options:EditOptions", "edit:edit"),
        CommandEntry("trash", "run_file_options:TrashOptions", "runs:trash"),
        CommandEntry("audit", "result_options:AuditOptions", "audit:audit"),
        CommandEntry("doctor", "run_file_options:DoctorOptions", "doctor:doctor"),
        CommandEntry(
            "calibrate", "device_options:CalibrateOptions", "calibrate:calibrate", group=CalibrateGroup
        ),
    )


class DeviceGroup(LazyGroup):
    """Commands of `slipstand device`."""

    entries = (
        CommandEntry("list", "device_options:ListDevicesOptions", "device:list_devices"),
        CommandEntry("ports", "device_options:ListPortsOptions", "device:list_ports"),
        CommandEntry("probe", "device_options:ProbeOptions", "device:probe"),
        CommandEntry("simulate", "device_options:SimulateDeviceOptions", "simulate_device:simulate_device"),
        CommandEntry("health", "device_options:HealthOptions", "health:health"),
    )


def _typer(**settings: Any) -> typer.Typer:
    return typer.Typer(
        **{"pretty_exceptions_enable": False, "add_completion": False, "rich_markup_mode": None} | settings
    )


app = _typer(
    cls=SlipstandGroup,
    add_completion=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Measures dry friction on a shaking stand. "
    "`slipstand` alone opens the window, `slipstand RUN.h5` opens a run in it, `slipstand --simulated` opens"
    " it on the simulated stand.",
)
app.add_typer(
    _typer(cls=DeviceGroup, help="Devices, ports and the simulated stand.", no_args_is_help=True),
    name="device",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"slipstand {version_text()}")
        raise typer.Exit


@app.callback()
def main_options(
    version: Annotated[  # noqa: ARG001 - its callback shows it
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show version and commit."),
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Write the log in detail, and to stderr as well.")
    ] = False,
) -> None:
    """Hold the options that stand before the command."""
    if verbose:
        start_log("command", "debug", on_stderr=True)
