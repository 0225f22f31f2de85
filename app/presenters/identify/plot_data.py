"""Plot data of an analysed run: curves, lines of the fitted motion, and words about f_d set by hand."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.catalogue import (
    ACCELERATION,
    MICROMETRE,
    MILLIMETRE,
    MILLIMETRES_PER_SECOND,
    Unit,
    displacement_unit,
    reading_units_on_screen,
)
from analysis.formatting import format_value, typeset, with_unit
from analysis.plate.trends import FrictionTrend
from app.presenters import number_text, results
from app.presenters.analysed_run import AnalysedRun, Channel, Objective
from app.presenters.identify.state import (
    ChannelCurves,
    Curves,
    Floats,
    Motion,
    PlotTab,
    PlottedQuantity,
    ReadingUnit,
    SlipPlot,
    SlipPlots,
)
from messages.i18n import N_, gettext

_DECIMALS = {MILLIMETRE: 3, MICROMETRE: 1, MILLIMETRES_PER_SECOND: 2, ACCELERATION: 3}
_TABLE, _PLATE = "u<sub>1</sub>", "u<sub>2</sub>"
_RELATIVE = f"{_PLATE} − {_TABLE}"
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
    unit, residual_unit = reading_units_on_screen(run.unit)
    channels = [channel for channel in (run.table, run.relative) if channel is not None]
    return Curves(
        time_s=run.time_s - origin_s,
        time_label=gettext(
            "time in the record, s" if run.events.release_s is None else "time from release, s"
        ),
        channels=tuple(_channel(channel, unit, residual_unit) for channel in channels),
        unit=_reading_unit(unit, channels),
        residual_unit=_reading_unit(residual_unit, channels),
        no_relative_reason="" if run.relative is not None else gettext(_NO_RELATIVE[run.kind]),
        slips=tuple((start_s - origin_s, end_s - origin_s) for start_s, end_s in _slips(run)),
        noise=None if run.model is None else run.model.noise_rms_m * residual_unit.scale,
        fitted=_fitted(run, origin_s),
    )


def measured_lines(shown: Curves) -> tuple[PlottedQuantity, ...]:
    """Records of the gauges, then the residuals."""
    gauges = list(zip((_TABLE, _RELATIVE), shown.channels, strict=False))

    def line(symbol: str, unit: ReadingUnit, values: Floats) -> PlottedQuantity:
        return PlottedQuantity(symbol, unit.symbol, unit.decimals, shown.time_s, values)

    records = [line(symbol, shown.unit, channel.record) for symbol, channel in gauges]
    residuals = [
        line(gettext("residual {symbol}", symbol=symbol), shown.residual_unit, channel.residual)
        for symbol, channel in gauges
        if channel.residual is not None
    ]
    return (*records, *residuals)


def motion(run: AnalysedRun) -> Motion | None:
    """Displacements, velocities and accelerations; None without a fitted motion."""
    found = run.kinematics
    if found is None:
        return None
    time_s = found.time_s - time_origin_s(run)

    def line(symbol: str, unit: Unit, values: Floats) -> PlottedQuantity:
        return PlottedQuantity(symbol, unit.symbol, _DECIMALS[unit], time_s, unit.scale * values)

    velocity = line(f"{_TABLE}′", MILLIMETRES_PER_SECOND, found.table_m_per_s)
    relative = line(_RELATIVE, displacement_unit(), found.relative_m)
    sliding = found.plate_m_per_s - found.table_m_per_s
    relative_velocity = line(f"{_PLATE}′ − {_TABLE}′", MILLIMETRES_PER_SECOND, sliding)
    return {
        PlotTab.VELOCITY: (
            velocity,
            line(f"{_PLATE}′", MILLIMETRES_PER_SECOND, found.plate_m_per_s),
            relative_velocity,
        ),
        PlotTab.ACCELERATION: (
            line(f"{_TABLE}″", ACCELERATION, found.table_m_per_s2),
            line(f"{_PLATE}″", ACCELERATION, found.plate_m_per_s2),
        ),
        PlotTab.RELATIVE: (
            line(f"{_PLATE}″ − {_TABLE}″", ACCELERATION, found.plate_m_per_s2 - found.table_m_per_s2),
            relative,
        ),
        PlotTab.PHASE: (
            line(_TABLE, displacement_unit(), found.table_m),
            velocity,
            relative,
            relative_velocity,
        ),
    }


def slip_plots(run: AnalysedRun) -> SlipPlots | None:
    """Friction of each slip; None without friction from the plate alone."""
    found = run.friction_by_slip
    if found is None:
        return None
    length = displacement_unit()
    return SlipPlots(
        (
            _slip_plot(found.with_velocity, gettext("sliding velocity, mm/s"), 1e3, "100 mm/s", 0.1),
            _slip_plot(
                found.with_position,
                gettext("position on the table, {unit}", unit=length.symbol),
                length.scale,
                "mm",
                1e-3,
            ),
            _slip_plot(found.with_time, gettext("time from release, s"), 1.0, "s", 1.0),
        ),
        results.sentence(found.statement),
    )


def _slip_plot(trend: FrictionTrend, axis: str, scale: float, unit: str, slope_scale: float) -> SlipPlot:
    slope = format_value(slope_scale * trend.slope, slope_scale * trend.slope_standard_uncertainty)
    template = (
        N_("f<sub>d</sub>: {slope} ± {uncertainty} per {unit}, zero within 95 %")
        if trend.includes_zero
        else N_("f<sub>d</sub>: {slope} ± {uncertainty} per {unit}, zero outside 95 %")
    )
    title = gettext(template, slope=typeset(slope.value), uncertainty=slope.uncertainty, unit=unit)
    return SlipPlot(title, axis, trend, scale)


def manual_fit_text(friction: float, objective: Objective) -> str:
    """Describe f_d set by hand: its difference from the fit, and the residual."""
    off_percent = 100.0 * (friction / objective.fitted - 1.0)
    return gettext(
        "By hand: {friction}, {off} from the fit; residual {residual}",
        friction=number_text.format_fixed(friction, 5),
        off=with_unit(typeset(f"{off_percent:+.2f}"), "%"),
        residual=results.format_micrometres(objective.residual_at(friction)),
    )


def _channel(channel: Channel, unit: Unit, residual_unit: Unit) -> ChannelCurves:
    record = unit.scale * channel.record_m
    if channel.fit_m is None or channel.residual_m is None:
        return ChannelCurves(record)
    return ChannelCurves(record, unit.scale * channel.fit_m, residual_unit.scale * channel.residual_m)


def _reading_unit(unit: Unit, channels: Sequence[Channel]) -> ReadingUnit:
    """The unit with decimals that show a ten-thousandth of the largest reading, where none are usual."""
    decimals = _DECIMALS.get(unit)
    if decimals is None:
        largest = max(float(np.nanmax(np.abs(channel.record_m), initial=0.0)) for channel in channels)
        decimals = 4 - math.ceil(math.log10(largest)) if 0.0 < largest < math.inf else 0
    return ReadingUnit(unit.symbol, max(0, decimals))


def _fitted(run: AnalysedRun, origin_s: float) -> tuple[float, float]:
    """From the release, if there is one, to the end of the free decay."""
    events = run.events
    start_s = -math.inf if events.release_s is None else 0.0
    return start_s, math.inf if events.free_decay_end_s is None else events.free_decay_end_s - origin_s


def _slips(run: AnalysedRun) -> tuple[tuple[float, float], ...]:
    """Slips of the fitted motion, else from release to slip end; empty if nothing slips."""
    if run.slips or run.events.release_s is None or results.FRICTION.name not in run.results:
        return run.slips
    end_s = float(run.time_s[-1]) if run.events.slip_end_s is None else run.events.slip_end_s
    return ((run.events.release_s, end_s),)
