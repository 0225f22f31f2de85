"""`slipstand device simulate`: the simulated stand on a port."""

import dataclasses
import sys
from functools import partial

import msgspec

from app.cli import output as out
from app.cli.device_options import SimulateDeviceOptions, StandOptions
from app.cli.option_values import checked, key_values
from app.runs.analysis_request import quote_command
from app.simulated_stand.client import Ready
from app.simulated_stand.effects import parse_effects
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.process import read_disturbances, serve, stop_on_signal_or_orphaned


def simulate_device(options: SimulateDeviceOptions) -> None:
    stand = _stand_options(options.stand, key_values(options.settings))
    if not options.as_json:
        out.print_status("starting; Ctrl-C ends it")
    read = read_disturbances(lambda fault: out.print_status(f"error: {fault}")) if options.control else None
    ended = stop_on_signal_or_orphaned()
    announce = partial(_announce, as_json=options.as_json)
    if read is None:
        serve(stand, announce, ended)
    else:
        serve(stand, announce, ended, next_disturbance=read.take)


def _announce(ready: Ready, *, as_json: bool) -> None:
    if as_json:
        sys.stdout.write(msgspec.json.encode(ready).decode() + "\n")
    else:
        rate = f"{ready.rate_hz:g} Hz"
        out.print_line(f"simulated stand {ready.series}, {ready.protocol}, {rate}: {ready.port}")
        if ready.calibration:
            out.print_line(f"record from it with --calibration {quote_command([ready.calibration])}")
    sys.stdout.flush()


def _stand_options(options: StandOptions, settings: dict[str, str]) -> SimulatedStandOptions:
    """Return the options of the stand. Raises CommandError for a value out of range."""
    values = dataclasses.asdict(options)
    if options.truth_file:
        values["truth_file"] = str(out.output_file(options.truth_file, force=True))
    if options.gauges_file:
        values["gauges_file"] = str(options.gauges_file.expanduser().resolve())
    values["effects"] = parse_effects(key_values(options.effects, "--effect"))
    values["disturbances"] = tuple(options.disturbances or ())
    return checked(SimulatedStandOptions, StandOptions, **values, device=settings)
