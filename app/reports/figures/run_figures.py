"""Figs. 3a to 5b of the paper for one run: displacements, velocities and accelerations of both plates."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.motion.motion import MotionSamples
from app.reports.figure_style import DASHED, PLATE, SIMULATION, TABLE, decimate_for_print, new_figure
from app.reports.figures.run_figure_data import RunFigureData
from app.reports.numbers import with_uncertainty

Floats = NDArray[np.float64]
Draw = Callable[[Axes, RunFigureData], None]


@dataclass(frozen=True, slots=True)
class RunFigure:
    """One of the paper's figures.

    Attributes
    ----------
    number : str
        In the paper: "3a".
    caption : str
    draw : callable
        Draws it.
    simulated : bool
        It shows the fitted motion, and is nothing without one.
    """

    number: str
    caption: str
    draw: Draw
    simulated: bool = True

    def render(self, run: RunFigureData, title: str = "") -> Figure | None:
        """Draw the figure within `look.print_style`; None where the run has nothing to show in it."""
        if self.simulated and run.motion is None:
            return None
        figure, axes = new_figure()
        self.draw(axes, run)
        axes.set_xlabel("time since release $t$ (s)")
        axes.margins(x=0.01)
        _shade_slip(axes, run)
        _legend(axes, 1 if self.number in _LONG_LABELS else 2)
        if title:
            figure.suptitle(title, fontsize=9, x=0.01, ha="left")
        return figure


def _table_displacement(axes: Axes, run: RunFigureData) -> None:
    _experiment(axes, run, run.table_m, TABLE)
    if run.motion is not None:
        _simulated(axes, run.motion.time_s, run.motion.table_displacement_m * 1e3)
    axes.set_ylabel("table $u_1$ (mm)")


def _both_displacements(axes: Axes, run: RunFigureData) -> None:
    motion = _motion(run)
    table, relative = motion.table_displacement_m, motion.relative_displacement_m
    _bodies(axes, motion.time_s, (table * 1e3, (table + relative) * 1e3), ("table $u_1$", "plate $u_2$"))
    axes.set_ylabel("displacement (mm)")


def _relative_displacement(axes: Axes, run: RunFigureData) -> None:
    if run.relative_m is not None:
        axes.plot(
            run.time_s, run.relative_m * 1e3, color=PLATE, linewidth=2.2, alpha=0.45, label="experiment"
        )
    if run.motion is not None:
        _simulated(axes, run.motion.time_s, run.motion.relative_displacement_m * 1e3)
    axes.set_ylabel("relative $u_2 - u_1$ (mm)")


def _velocities(axes: Axes, run: RunFigureData) -> None:
    motion = _motion(run)
    both = motion.table_velocity_m_per_s, motion.plate_velocity_m_per_s
    _rates(axes, run, both, ("v", "velocity", "m/s"), "velocity_max_m_per_s")


def _accelerations(axes: Axes, run: RunFigureData) -> None:
    motion = _motion(run)
    both = motion.table_acceleration_m_per_s2, motion.plate_acceleration_m_per_s2
    _rates(axes, run, both, ("a", "acceleration", "m/s²"), "acceleration_max_m_per_s2")


def _rates(
    axes: Axes, run: RunFigureData, both: tuple[Floats, Floats], words: tuple[str, str, str], largest: str
) -> None:
    """Both bodies with their largest values; `words` are symbol, name and unit."""
    symbol, name, unit = words
    table = f"${symbol}_1$, at most {_largest(run, f'table_{largest}', unit)}"
    plate = f"${symbol}_2$, at most {_largest(run, f'plate_{largest}', unit)}"
    _bodies(axes, _motion(run).time_s, both, (table, plate))
    axes.set_ylabel(f"{name} ({unit})")


def _relative_acceleration(axes: Axes, run: RunFigureData) -> None:
    motion = _motion(run)
    relative = motion.plate_acceleration_m_per_s2 - motion.table_acceleration_m_per_s2
    label = f"$a_2 - a_1$, at most {np.abs(relative).max():.3g}"
    axes.plot(motion.time_s, relative, color=PLATE, linewidth=0.9, label=label)
    axes.set_ylabel("relative acceleration (m/s²)")


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
    """Broad and pale under the simulation; a plain line where there is none."""
    width, alpha = (0.8, 1.0) if run.motion is None else (2.2, 0.45)
    axes.plot(
        *decimate_for_print(run.time_s, reading_m * 1e3),
        color=colour,
        linewidth=width,
        alpha=alpha,
        label="experiment",
    )


def _simulated(axes: Axes, time_s: Floats, value: Floats) -> None:
    axes.plot(time_s, value, color=SIMULATION, linewidth=0.8, linestyle=DASHED, label="simulation")


def _bodies(axes: Axes, time_s: Floats, values: tuple[Floats, Floats], labels: tuple[str, str]) -> None:
    """Table and plate, told apart by colour and dash."""
    axes.plot(time_s, values[0], color=TABLE, linewidth=0.9, label=labels[0])
    axes.plot(time_s, values[1], color=PLATE, linewidth=1.1, linestyle=DASHED, label=labels[1])


def _largest(run: RunFigureData, name: str, unit: str) -> str:
    found = run.results.get(name)
    return (
        "what is not known"
        if found is None
        else with_uncertainty(found.value, found.standard_uncertainty, unit)
    )


def _legend(axes: Axes, columns: int) -> None:
    """Above the axes, where it covers no curve."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1, ncols=columns, handlelength=2.6
    )


_LONG_LABELS = ("4b", "5a")


def _shade_slip(axes: Axes, run: RunFigureData) -> None:
    if run.slip_end_s is not None:
        axes.axvspan(0.0, run.slip_end_s, color=PLATE, alpha=0.1, linewidth=0)
