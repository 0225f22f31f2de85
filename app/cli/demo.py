"""`slipstand demo`: one pullback of the simulated stand, from the wire to f_d, found beside true."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.errors import CommandError
from app.cli.options import Dask, Directory, Jobs, Json, crew_options, positive

if TYPE_CHECKING:
    from app.acquisition.messages import RunEnded
    from app.runs.batch.choice import CrewOptions
    from app.simulated_stand.truth import StandTruth

_RECORD_S = 8.0
"""The demo's run ends this long after release."""


def demo(
    series: Annotated[
        str | None, typer.Option("--series", help="Series code; with --campaign several, 1FFM0,1FFM1.")
    ] = None,
    friction: Annotated[float | None, typer.Option(help="True f_d; the series' if absent.")] = None,
    directory: Directory = None,
    campaign: Annotated[
        bool, typer.Option("--campaign", help="All series of Table 1, each some times, not in real time.")
    ] = False,
    repeats: Annotated[int, typer.Option(help="With --campaign: tests of each series.")] = 3,
    scatter: Annotated[
        float, typer.Option(help="With --campaign: standard deviation of f_d from run to run, as a share.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(help="With --campaign: of everything that is drawn.")] = 1,
    jobs: Jobs = None,
    dask: Dask = "",
    as_json: Json = False,
) -> None:
    """Record a simulated pullback, and compare it with the truth.

    The simulated stand is read over a real serial port; the run is kept, identified and drawn.

    With --campaign the 36 series of Table 1 are simulated, read by gauges that err as they state, and stored
    as runs; their table is held against the truth.
    """
    if campaign:
        _campaign(series, friction, directory, (repeats, scatter, seed), crew_options(jobs, dask), as_json)
        return
    _one_test(series, friction, directory, as_json)


def _campaign(
    series: str | None,
    friction: float | None,
    directory: Path | None,
    drawn: tuple[int, float, int],
    crew: "CrewOptions",
    as_json: bool,
) -> None:
    from app.cli.demo_campaign import demo_campaign
    from app.simulated_stand.campaign.tests import CampaignOptions

    if friction is not None:
        raise CommandError("--friction is of one test. In a campaign f_d is that of Table 1")
    repeats, scatter, seed = drawn
    codes = tuple(code.strip() for code in (series or "").split(",") if code.strip())
    try:
        options = CampaignOptions(series=codes, repeats=repeats, friction_scatter=scatter, seed=seed)
    except ValueError as error:
        raise CommandError(str(error)) from None
    demo_campaign(options, directory, crew, as_json=as_json)


def _one_test(series: str | None, friction: float | None, directory: Path | None, as_json: bool) -> None:
    from app.acquisition.messages import EndReason, PortSettings, RunSettings
    from app.cli import output as out
    from app.cli.recording import gauges_file_of, record_each
    from app.runs.places import recordings_directory
    from app.simulated_stand.client import SimulatedStand
    from app.simulated_stand.options import SimulatedStandOptions

    positive("--friction", friction)
    out.tell("starting the simulated stand (a first start compiles the solver, up to a minute)")
    try:
        options = SimulatedStandOptions(series=series or "1FFM0", friction=friction, decay_s=_RECORD_S + 2.0)
    except ValueError as error:
        raise CommandError(str(error)) from None
    with SimulatedStand.start(options) as stand:
        port = PortSettings(url=stand.port, protocol=options.protocol, rate_hz=options.rate_hz)
        run = RunSettings(
            directory=str(directory.expanduser().resolve() if directory else recordings_directory()),
            series=options.series,
            duration_s=_RECORD_S,
            operator="demo",
            note="recorded from the simulated stand",
        )
        (ended,) = record_each(port, run, gauges_file_of(None), simulated=True)
        truth = stand.truth().stand
    if ended.ended == EndReason.INTERRUPTED:
        raise typer.Exit(130)
    if ended.ended != EndReason.DURATION:
        raise CommandError(f"the demo's run ended: {ended.ended}. {ended.message} (kept in {ended.path})")
    _report(ended, truth, as_json)


def _report(ended: "RunEnded", truth: "StandTruth", as_json: bool) -> None:
    import msgspec

    from app.cli import output as out
    from app.cli.analysis_text import show
    from app.cli.analyze import draw
    from app.runs.analysing import AnalysisRequest, analyze_run

    path = Path(ended.path)
    with out.progress("identifying", total=1.0) as update:
        analysis = analyze_run(path, AnalysisRequest(), save=True, progress=update)
    figure = path.with_suffix(".png")
    draw(analysis, figure)
    document = analysis.document | {"truth": msgspec.to_builtins(truth), "figure": str(figure)}
    if as_json:
        out.emit_json(document)
        return
    show(analysis.document)
    _compare(document)
    out.say(f"  figure         {figure}")


_COMPARED = (
    ("friction_dynamic", "f_d", 1.0, ""),
    ("tilt_rad", "tilt", 1e3, "mrad"),
    ("period_s", "T", 1e3, "ms"),
    ("damping_n1_per_s", "n1", 1.0, "1/s"),
    ("stiffness_n_per_m", "c", 1.0, "N/m"),
    ("pullback_m", "u0", 1e3, "mm"),
)


def _compare(document: dict[str, Any]) -> None:
    """Write found beside true, and their difference in per cent and in standard uncertainties."""
    from app.cli import output as out

    rows = []
    for key, symbol, scale, unit in _COMPARED:
        found, true = document["results"].get(key), document["truth"][key]
        if found is None:
            continue
        uncertainty = found["standard_uncertainty"] or 0.0
        off = found["value"] - true
        per_cent = f"{100 * off / true:+.3f} %" if true else ""
        spread = f"{off / uncertainty:+.1f} u" if uncertainty else ""
        name = f"{symbol} {unit}".rstrip()
        shown = out.rounded(found["value"] * scale, uncertainty * scale)
        rows.append((name, shown, f"{true * scale:.6g}", per_cent, spread))
    out.table(("", "found", "true", "off by", ""), rows)
