"""`slipstand device simulate`: the simulated stand on a port."""

import dataclasses
import sys
from pathlib import Path
from typing import Any

import msgspec

from app.cli import output as out
from app.cli.device_options import SimulateDeviceOptions, StandOptions
from app.cli.errors import CommandError
from app.cli.option_values import key_values
from app.simulated_stand.client import Ready
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.process import read_disturbances, serve, stop_on_signal_or_orphaned


def simulate_device(options: SimulateDeviceOptions) -> None:
    """Be a simulated stand on a port until interrupted."""
    _serve(_stand_options(options.stand, key_values(options.settings)), options.control, options.as_json)


def _stand_options(stand: StandOptions, settings: dict[str, str]) -> SimulatedStandOptions:
    """Return the options of the stand. Raises CommandError for a value out of range."""
    if stand.truth_file is not None and not stand.truth_file.expanduser().absolute().parent.is_dir():
        raise CommandError(
            f"--truth {stand.truth_file}: there is no such folder. Make it first or choose another path"
        )
    values: dict[str, Any] = {name: _plain(value) for name, value in dataclasses.asdict(stand).items()}
    values["disturbances"] = tuple(stand.disturbances or ())
    try:
        return SimulatedStandOptions(**values, device=settings)
    except ValueError as error:
        raise CommandError(str(error)) from None


def _plain(value: object) -> object:
    return str(value.expanduser().resolve()) if isinstance(value, Path) else value


def _serve(options: SimulatedStandOptions, control: bool, as_json: bool) -> None:
    def announce(ready: Ready) -> None:
        if as_json:
            sys.stdout.write(msgspec.json.encode(ready).decode() + "\n")
        else:
            out.print_line(
                f"simulated stand {ready.series}, {ready.protocol}, {ready.rate_hz:g} Hz: {ready.port}"
            )
        sys.stdout.flush()

    if not as_json:
        out.print_status("starting; Ctrl-C ends it")
    orders = read_disturbances(lambda fault: out.print_status(f"error: {fault}")) if control else None
    ended = stop_on_signal_or_orphaned()
    if orders is None:
        serve(options, announce, ended)
    else:
        serve(options, announce, ended, next_disturbance=orders.take)
