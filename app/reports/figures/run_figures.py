"""The paper's figures: 2 of all contacts, 3a to 5b (displacements, velocities, accelerations) of one run."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from analysis.campaign.contacts import ContactFriction
from analysis.catalogue import (
    ACCELERATION,
    METRES_PER_SECOND,
    MILLIMETRE,
    Place,
    Unit,
    definition,
    reading_units,
)
from analysis.identification import Identification
from analysis.laws.stand_parts import model_law, simulate_fit
from analysis.motion.two_mass import Motion, MotionSamples
from analysis.plate.friction import PlateFriction
from analysis.quantities import Quantity
from analysis.record import Record
from app.reports.figures.style import (
    DASHED,
    HEIGHT_IN,
    PLATE,
    SIMULATION,
    TABLE,
    decimate_for_print,
    new_figure,
    place_legend_above,
)
from config.schema import Stand

Floats = NDArray[np.float64]
_BEFORE_PERIODS, _AFTER_PERIODS = 0.75, 5.0  # periods shown before the release, and after the last slip
_WITHOUT_SLIP_PERIODS = 15.0
_PER_PERIOD = 200
_USUAL_PERIOD_S = 0.3
_JUST_BEFORE_S = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class RunFigureData:
    """Curves of a run. Displacements are from rest, and from the position of the plate before the pull."""

    time_s: Floats  # (n,) float64: times of the readings since the release
    table_m: Floats
    relative_m: Floats | None  # (n,) float64 or None: plate against table; None without a second gauge
    motion: MotionSamples | None  # of the fitted law; None without one
    slip_end_s: float | None
    results: dict[str, Quantity]
    unit: str = "m"  # of the readings
    plate: PlateFriction | None = None  # its times are those of the record, in which the release is at
    release_s: float = 0.0

    @classmethod
    def from_identification(cls, record: Record, found: Identification, unit: str = "m") -> Self:
        release_s = found.events.release_s or float(record.time_s[0])
        first_s, last_s = _span_s(record, found, release_s)
        since_s = record.time_s - release_s
        shown = (since_s >= first_s) & (since_s <= last_s)
        motion = _fitted_motion(record, found)
        at_readings = None if motion is None else _displacements(motion, since_s[shown])
        table, relative = _readings(record, found, shown, at_readings)
        return cls(
            since_s[shown],
            table,
            relative,
            None if motion is None else motion.sample(_times(motion, first_s, last_s, _period_s(found))),
            None if found.events.slip_end_s is None else found.events.slip_end_s - release_s,
            found.results,
            unit,
            found.plate,
            release_s,
        )


def _span_s(record: Record, found: Identification, release_s: float) -> tuple[float, float]:
    period_s = _period_s(found)
    if found.events.slip_end_s is not None:
        last_s = found.events.slip_end_s - release_s + _AFTER_PERIODS * period_s
    elif found.model is None:
        last_s = _WITHOUT_SLIP_PERIODS * period_s
    else:
        last_s = float("inf")
    return -_BEFORE_PERIODS * period_s, min(last_s, float(record.time_s[-1]) - release_s)


def _period_s(found: Identification) -> float:
    return found.results["period_s"].value if "period_s" in found.results else _USUAL_PERIOD_S


def _fitted_motion(record: Record, found: Identification) -> Motion | None:
    if found.model is None or "release_s" not in found.parameters:
        return None
    duration_s = float(record.time_s[-1]) - found.parameters["release_s"]
    law = model_law(found.model.name, found.model.parts)
    return simulate_fit(law, found.parameters, duration_s)


def _times(motion: Motion, first_s: float, last_s: float, period_s: float) -> Floats:
    """Even grid, with both sides of each transition between stick and slip."""
    last_s = min(last_s, motion.duration_s)
    count = round((last_s - first_s) / period_s * _PER_PERIOD) + 2
    starts = motion.phase_starts_s[motion.phase_starts_s <= last_s]
    return np.unique(np.concatenate((np.linspace(first_s, last_s, count), starts, starts - _JUST_BEFORE_S)))


def _displacements(motion: Motion, since_s: Floats) -> tuple[Floats, Floats]:
    return motion.sample_displacements(np.minimum(since_s, motion.duration_s))


def _readings(
    record: Record, found: Identification, shown: NDArray[np.bool_], motion_m: tuple[Floats, Floats] | None
) -> tuple[Floats, Floats | None]:
    gauges = [record.table_displacement_m, record.relative_displacement_m]
    if motion_m is None or found.curves is None:
        rest = [None if gauge is None else gauge[shown] - _middle(gauge) for gauge in gauges]
        return (rest[0] if rest[0] is not None else np.empty(0)), rest[1]
    curves = found.curves(record.time_s[shown])
    table_m, relative_m = motion_m
    table = _placed(record.table_displacement_m[shown], curves.table_displacement_m, [table_m])
    if record.relative_displacement_m is None or curves.relative_displacement_m is None:
        return table, None
    reading_m = record.relative_displacement_m[shown]
    return table, _placed(reading_m, curves.relative_displacement_m, [relative_m, table_m + relative_m])


def _middle(reading_m: Floats) -> float:
    """Mean of a gauge over the second half of a record; 0 without readings."""
    late = reading_m[len(reading_m) // 2 :]
    late = late[np.isfinite(late)]
    return float(late.mean()) if len(late) else 0.0


def _placed(reading_m: Floats, curve_m: Floats, measured_m: list[Floats]) -> Floats:
    """The first of `measured_m` plus the residual, with the sign of a reversed gauge.

    A gauge is reversed where its curve runs against every motion that it may measure.
    """
    alike = [_likeness(curve_m, one_m) for one_m in measured_m]
    side = -1.0 if max(alike, key=abs) < 0.0 else 1.0
    return np.asarray(measured_m[0] + side * (reading_m - curve_m))


def _likeness(one_m: Floats, other_m: Floats) -> float:
    """Coefficient of correlation; 0 where a curve is constant."""
    one_m, other_m = one_m - one_m.mean(), other_m - other_m.mean()
    size = float(np.sqrt(np.dot(one_m, one_m) * np.dot(other_m, other_m)))
    return float(np.dot(one_m, other_m)) / size if size > 0.0 else 0.0


Draw = Callable[[Axes, RunFigureData], None]


@dataclass(frozen=True, slots=True)
class RunFigure:
    number: str
    caption: str
    draw: Draw
    simulated: bool = True  # it shows the fitted motion, and needs one

    def render(self, run: RunFigureData, title: str = "", height_in: float = HEIGHT_IN) -> Figure | None:
        if self.simulated and run.motion is None:
            return None
        figure, axes = new_figure(height_in)
        self.draw(axes, run)
        axes.set_xlabel("time since release $t$ (s)")
        axes.margins(x=0.01)
        if run.slip_end_s is not None:
            axes.axvspan(0.0, run.slip_end_s, color=PLATE, alpha=0.1, linewidth=0)
        place_legend_above(axes, ncols=1 if self.number in _LONG_LABELS else 2, handlelength=2.6)
        if title:
            figure.suptitle(title, fontsize=9, x=0.01, ha="left")
        return figure


def _table_displacement(axes: Axes, run: RunFigureData) -> None:
    _experiment(axes, run, run.table_m, TABLE)
    _simulated(axes, run.motion, "table_displacement_m")
    axes.set_ylabel(reading_units(run.unit)[0].labelled("table $u_1$"))


def _both_displacements(axes: Axes, run: RunFigureData) -> None:
    motion = _motion(run)
    table = MILLIMETRE.scale * motion.table_displacement_m
    plate = table + MILLIMETRE.scale * motion.relative_displacement_m
    _bodies(axes, motion.time_s, (table, plate), ("table $u_1$", "plate $u_2$"))
    axes.set_ylabel(MILLIMETRE.labelled("displacement"))


def _relative_displacement(axes: Axes, run: RunFigureData) -> None:
    if run.relative_m is not None:
        relative = reading_units(run.unit)[0].scale * run.relative_m
        axes.plot(run.time_s, relative, color=PLATE, linewidth=2.2, alpha=0.45, label="experiment")
    _simulated(axes, run.motion, "relative_displacement_m")
    axes.set_ylabel(reading_units(run.unit)[0].labelled("relative $u_2 - u_1$"))


def _rates(axes: Axes, run: RunFigureData, symbol: str, rate: str, unit: Unit, suffix: str) -> None:
    """Draw a rate of both bodies with its largest values."""
    motion, curves, labels = _motion(run), [], []
    for number, body in enumerate(("table", "plate"), start=1):
        name = f"{body}_{rate}_max_{suffix}"
        largest = run.results.get(name)
        shown = "unknown" if largest is None else definition(name).format(largest, Place.REPORT).in_print
        labels.append(f"${symbol}_{number}$, at most {shown}")
        curves.append(getattr(motion, f"{body}_{rate}_{suffix}"))
    _bodies(axes, motion.time_s, (curves[0], curves[1]), (labels[0], labels[1]))
    axes.set_ylabel(unit.labelled(rate))


def _velocities(axes: Axes, run: RunFigureData) -> None:
    _rates(axes, run, "v", "velocity", METRES_PER_SECOND, "m_per_s")


def _accelerations(axes: Axes, run: RunFigureData) -> None:
    _rates(axes, run, "a", "acceleration", ACCELERATION, "m_per_s2")


def _relative_acceleration(axes: Axes, run: RunFigureData) -> None:
    motion = _motion(run)
    relative = motion.plate_acceleration_m_per_s2 - motion.table_acceleration_m_per_s2
    axes.plot(motion.time_s, relative, color=PLATE, linewidth=0.9, label="$a_2 - a_1$")
    axes.set_ylabel(ACCELERATION.labelled("relative acceleration"))


RUN_FIGURES: Final = (
    RunFigure("3a", "Displacement of the table: experiment and simulation.", _table_displacement, False),
    RunFigure("3b", "Displacements of table and plate (simulation).", _both_displacements),
    RunFigure(
        "4a",
        "Displacement of the plate against the table: experiment and simulation.",
        _relative_displacement,
        False,
    ),
    RunFigure("4b", "Velocities of table and plate (simulation).", _velocities),
    RunFigure("5a", "Accelerations of table and plate (simulation).", _accelerations),
    RunFigure("5b", "Acceleration of the plate against the table (simulation).", _relative_acceleration),
)
"""In the paper's order."""


def _motion(run: RunFigureData) -> MotionSamples:
    if run.motion is None:
        raise ValueError("the run has no fitted motion: only Figs. 3a and 4a can be drawn")
    return run.motion


def _experiment(axes: Axes, run: RunFigureData, reading_m: Floats, colour: str) -> None:
    width, alpha = (0.8, 1.0) if run.motion is None else (2.2, 0.45)
    curve = decimate_for_print(run.time_s, reading_units(run.unit)[0].scale * reading_m)
    axes.plot(*curve, color=colour, linewidth=width, alpha=alpha, label="experiment")


def _simulated(axes: Axes, motion: MotionSamples | None, name: str) -> None:
    if motion is not None:
        value_mm = MILLIMETRE.scale * getattr(motion, name)
        axes.plot(
            motion.time_s, value_mm, color=SIMULATION, linewidth=0.8, linestyle=DASHED, label="simulation"
        )


def _bodies(axes: Axes, time_s: Floats, values: tuple[Floats, Floats], labels: tuple[str, str]) -> None:
    axes.plot(time_s, values[0], color=TABLE, linewidth=0.9, label=labels[0])
    axes.plot(time_s, values[1], color=PLATE, linewidth=1.1, linestyle=DASHED, label=labels[1])


_LONG_LABELS = ("4b", "5a")


CAPTION: Final = (
    "Static and dynamic friction by contact. Bars: mean over the series, with its 95 % interval; points:"
    " series, with theirs (f_s from its bounds where no law determined it); triangles: series that bound f_s"
    " from below only."
)
_WIDTH = 0.36
_SPREAD = 0.22
_STATIC_SHADE, _DYNAMIC_SHADE = 0.55, 0.2
_NAME_LENGTH = 14


def contact_names(stands: Iterable[Stand]) -> dict[str, str]:
    return {code: contact.name for stand in stands for code, contact in stand.contacts.items()}


def friction_figure(contacts: Sequence[ContactFriction], names: Mapping[str, str]) -> Figure | None:
    """Draw Fig. 2 within `print_style`; None without any. `names` are those of the contacts."""
    shown = [one for one in contacts if one.dynamic or one.static or one.static_at_least]
    if not shown:
        return None
    figure, axes = new_figure(height_in=2.8)
    for place, contact in enumerate(shown):
        left, right, least = place - _WIDTH / 2, place + _WIDTH / 2, list(contact.static_at_least.values())
        _bar(axes, left, contact.static, contact.static_of_series, TABLE, _STATIC_SHADE)
        axes.plot(_beside(left, len(least)), least, color=TABLE, linestyle="", marker="^", markersize=4.0)
        _bar(axes, right, contact.dynamic, contact.dynamic_of_series, PLATE, _DYNAMIC_SHADE)
    axes.set_xticks(range(len(shown)), [_label(one.contact, names) for one in shown])
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.6, len(shown) - 0.4)
    axes.set_ylim(bottom=0.0)
    axes.grid(visible=False, axis="x")
    axes.set_ylabel("friction coefficient")
    handles: list[Patch | Line2D] = [
        Patch(**_look(TABLE, _STATIC_SHADE), label="static $f_s$"),
        Patch(**_look(PLATE, _DYNAMIC_SHADE), label="dynamic $f_d$"),
    ]
    if any(one.static_at_least for one in shown):
        handles.append(Line2D([], [], color=TABLE, linestyle="", marker="^", label="$f_s$ at least"))
    place_legend_above(axes, handles=handles, ncols=3)
    return figure


def _bar(
    axes: Axes, place: float, mean: Quantity | None, series: Mapping[str, Quantity], colour: str, shade: float
) -> None:
    if mean is None:
        return
    axes.bar(place, mean.value, _WIDTH * 0.92, **_look(colour, shade))
    for at, one in zip(_beside(place, len(series)), series.values(), strict=True):
        _with_interval(axes, at, one, "o", 2.0, 0.6)
    _with_interval(axes, place, mean, "", 0.0, 1.4)


def _with_interval(axes: Axes, place: float, found: Quantity, mark: str, size: float, width: float) -> None:
    low, high = found.interval_95
    reach = np.nan_to_num(np.maximum([[found.value - low], [high - found.value]], 0.0))
    axes.errorbar(
        place, found.value, yerr=reach, fmt=mark or "none", color=SIMULATION, ecolor=SIMULATION,
        markersize=size, elinewidth=width, capsize=3.0 if not mark else 1.5, capthick=width,
    )  # fmt: skip


def _beside(place: float, count: int) -> list[float]:
    """Places of points that would hide one another."""
    even = count + count % 2  # none in the middle, where the mean's interval is
    return list(place + np.linspace(-_SPREAD / 2, _SPREAD / 2, even)[:count])


def _look(colour: str, shade: float) -> dict[str, Any]:
    """Return an opaque tint, darker for f_s, so that both differ in grey print; patterns print unevenly."""
    ink = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)])
    face = tuple(np.round(255.0 - shade * (255.0 - ink)) / 255.0)
    return {"facecolor": face, "edgecolor": colour, "linewidth": 0.8}


def _label(contact: str, names: Mapping[str, str]) -> str:
    if not contact:
        return "contact\nunknown"
    lines = [contact]
    for word in names.get(contact, "").split():
        if len(lines) > 1 and len(lines[-1]) + len(word) < _NAME_LENGTH:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return "\n".join(lines)
