"""Plot data of an analysed run: curves, motion, scan of f_d, and the simulation with f_d set by hand."""

import numpy as np

from analysis.formatting import typeset, with_unit
from app.presenters import number_text, results
from app.presenters.analysed_run import AnalysedRun, Channel, Objective
from app.presenters.identify.state import (
    ChannelCurves,
    Curves,
    DecimatedLine,
    ManualFit,
    ManualSimulation,
    Motion,
    PlotLine,
    Scan,
)
from messages.i18n import N_, gettext

_NO_RELATIVE = {
    "two-mass": N_("this run has no second gauge"),
    "one-mass": N_("gauge 2 plays no part where one mass moves"),
}


def time_origin_s(run: AnalysedRun) -> float:
    """Time of the record (s) that is drawn as 0: the release, else the first sample."""
    return float(run.time_s[0]) if run.events.release_s is None else run.events.release_s


def time_span(run: AnalysedRun) -> tuple[float, float]:
    """First and last time of a run (s) from its origin."""
    origin_s = time_origin_s(run)
    return float(run.time_s[0]) - origin_s, float(run.time_s[-1]) - origin_s


def curves(run: AnalysedRun) -> Curves:
    """Record, simulation and residual."""
    origin_s = time_origin_s(run)
    return Curves(
        time_s=run.time_s - origin_s,
        time_label=gettext(
            "time in the record, s" if run.events.release_s is None else "time from release, s"
        ),
        table=_channel(run.table),
        relative=None if run.relative is None else _channel(run.relative),
        no_relative_reason="" if run.relative is not None else gettext(_NO_RELATIVE[run.kind]),
        slips=tuple((start_s - origin_s, end_s - origin_s) for start_s, end_s in _slips(run)),
        noise_um=None if run.model is None else run.model.noise_rms_m * 1e6,
    )


def motion(run: AnalysedRun) -> Motion | None:
    """Velocities and accelerations; None without a fitted motion."""
    found = run.kinematics
    if found is None:
        return None
    return Motion(
        time_s=found.time_s - time_origin_s(run),
        table_mm=found.table_m * 1e3,
        relative_mm=found.relative_m * 1e3,
        table_mm_per_s=found.table_m_per_s * 1e3,
        plate_mm_per_s=found.plate_m_per_s * 1e3,
        relative_mm_per_s=(found.plate_m_per_s - found.table_m_per_s) * 1e3,
        table_m_per_s2=found.table_m_per_s2,
        plate_m_per_s2=found.plate_m_per_s2,
        relative_m_per_s2=found.plate_m_per_s2 - found.table_m_per_s2,
    )


def scan(objective: Objective | None) -> Scan | None:
    """Residual against f_d."""
    if objective is None:
        return None
    return Scan(objective.friction, objective.residual_m * 1e6, objective.fitted, objective.interval_95)


def manual_fit(found: ManualSimulation, origin_s: float, objective: Objective) -> ManualFit:
    """Simulation with f_d set by hand, and its difference from the fit."""
    off_percent = 100.0 * (found.friction / objective.fitted - 1.0)
    words = gettext(
        "By hand: {friction}, {off} from the fit; residual {residual}",
        friction=number_text.format_fixed(found.friction, 5),
        off=with_unit(typeset(f"{off_percent:+.2f}"), "%"),
        residual=results.format_micrometres(objective.residual_at(found.friction)),
    )
    return ManualFit(
        found.friction,
        words,
        tuple(_line(line, origin_s, 1e3) for line in found.simulations),
        tuple(_line(line, origin_s, 1e6) for line in found.residuals),
    )


def missing_share(run: AnalysedRun) -> float:
    """Share of missing samples of the table gauge."""
    return float(np.isnan(run.table.record_m).mean())


def _line(line: DecimatedLine, origin_s: float, scale: float) -> PlotLine:
    return PlotLine(line.time_s - origin_s, line.value_m * scale)


def _channel(channel: Channel) -> ChannelCurves:
    if channel.fit_m is None or channel.residual_m is None:
        return ChannelCurves(channel.record_m * 1e3)
    return ChannelCurves(channel.record_m * 1e3, channel.fit_m * 1e3, channel.residual_m * 1e6)


def _slips(run: AnalysedRun) -> tuple[tuple[float, float], ...]:
    """Slips of the fitted motion, else from release to slip end; empty if nothing slips."""
    if run.slips or run.events.release_s is None or results.FRICTION.name not in run.results:
        return run.slips
    end_s = float(run.time_s[-1]) if run.events.slip_end_s is None else run.events.slip_end_s
    return ((run.events.release_s, end_s),)
