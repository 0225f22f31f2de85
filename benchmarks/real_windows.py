"""Windows of public free decays against reference ranges of T, n and x_k, and the degree an expert gives.

`python -m benchmarks.real_windows FOLDER` prints a line for each window and the counts. FOLDER holds a clone
of each repository under its own name:

    git clone https://github.com/zualo/strain-gauges-and-vibrations
    git clone https://github.com/moorepants/resonance
    git clone https://github.com/filo0509/smorzamento
    git clone https://github.com/Sven-vandenBergh/M24-25-Lab-OSC-data
    git clone https://github.com/joshniemela/TunedMassDamper
    git clone https://github.com/Jeffreymaomao/Coupled-Oscillators.github.io

Most carry no licence, so nothing of them is kept here. The ranges are fits by an event-driven integrator that
is not the project's.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from analysis.arrays import Floats
from analysis.one_mass.identify import identify_one_mass, single_channel
from analysis.quantities import Quantity
from analysis.record import AnalysisError

Load = Callable[[Path], tuple[Floats, Floats]]
Range = tuple[float, float]
REFUSED = "refused"
DECAY = frozenset({"ideal", "stand", "friction"})
NO_DECAY = frozenset({"none", REFUSED})
TWO_MASSES = frozenset({"none", "friction", REFUSED})


@dataclass(frozen=True)
class Reference:
    """Ranges of period (s), damping (1/s) and x_k; None: no dry friction."""

    period_s: Range
    damping_per_s: Range
    coulomb: Range | None


@dataclass(frozen=True)
class Window:
    """Part of a record, and the degrees that an expert gives it."""

    name: str
    load: Load
    degrees: frozenset[str]
    unit: str = "m"
    quantity: Literal["displacement", "velocity"] = "displacement"
    reference: Reference | None = None
    start_s: float = 0.0
    end_s: float = np.inf
    step: int = 1  # every so many readings


CANTILEVER = {
    3: Reference((0.08308, 0.08318), (0.130, 0.136), None),
    4: Reference((0.03932, 0.03936), (0.345, 0.375), None),
}
WHEEL = Reference((0.42126, 0.42146), (0.116, 0.146), (1.5e-3, 2.1e-3))
CUTS = (
    (0.0, np.inf, 20),
    (0.0, np.inf, 5),
    (0.2, np.inf, 20),
    (0.5, np.inf, 20),
    (0.0, 0.8, 20),
    (0.3, 1.2, 20),
)
WHEEL_CUTS = (
    (0.0, np.inf, 1),
    (0.1, np.inf, 1),
    (0.3, np.inf, 1),
    (0.0, 1.7, 1),
    (0.0, np.inf, 4),
    (0.0, np.inf, 10),
)
"""From, until (s), every so many readings."""
NO_COULOMB = 0.01  # share of the range below which a significant x_k still counts as none


def read_table(path: Path, separator: str = ",", *, comma: bool = False) -> Floats:
    """Rows of numbers of a text, NaN where a cell is empty or a row is short; other rows are left out."""
    rows: list[list[float]] = []
    for line in path.read_text(encoding="utf-8-sig").splitlines():
        cells = [cell.strip().strip('"') for cell in line.split(separator)]
        try:
            rows.append(
                [float(cell.replace(",", ".") if comma else cell) if cell else np.nan for cell in cells]
            )
        except ValueError:
            continue
    width = max(map(len, rows))
    return np.array([row + [np.nan] * (width - len(row)) for row in rows])


def cantilever(number: int, folder: Path) -> tuple[Floats, Floats]:
    table = read_table(folder / "strain-gauges-and-vibrations" / f"4L/OData{number}.csv")
    table = table[~np.isnan(table[:, 1])]
    table = table[4:] if table[0, 1] > table[5, 1] else table
    return table[:, 1], table[:, 0]


def wheel(kind: str, folder: Path) -> tuple[Floats, Floats]:
    name = f"notebooks/03/bicycle-wheel-{kind}-inertia-rate-gyro-measurement.csv"
    table = read_table(folder / "resonance" / name)
    return table[:, 0], table[:, 1]


def disc(name: str, folder: Path) -> tuple[Floats, Floats]:
    table = read_table(folder / "smorzamento" / f"data_raw/{name}.csv", ";", comma=True)
    table = table[~np.isnan(table[:, :2]).any(axis=1)]
    return table[:, 0], table[:, 1]


def rotary(name: str, run: int, folder: Path) -> tuple[Floats, Floats]:
    text = (folder / "M24-25-Lab-OSC-data" / "10-12-24-OS-2SB" / name).read_text(encoding="utf-8-sig")
    head, *rows = (line.split(";") for line in text.splitlines())
    at = [cell.strip('"') for cell in head].index(f"Angle, Ch 1+2 (rad) Run #{run}")
    angle = np.array([float(row[at].replace(",", ".")) for row in rows if len(row) > at and row[at]])
    return 0.05 * np.arange(len(angle), dtype=np.float64), angle


def damper(column: int, folder: Path) -> tuple[Floats, Floats]:
    table = read_table(folder / "TunedMassDamper" / "dataCollection/resultingData.csv")
    return table[:, 0], table[:, column] * 1e-3


def carts(name: str, column: int, folder: Path) -> tuple[Floats, Floats]:
    path = folder / "Coupled-Oscillators.github.io" / "Exprimental-Calculation/data" / f"{name}.csv"
    table = read_table(path)
    table = table[np.concatenate(([True], np.diff(table[:, 0]) > 0))]
    return table[:, 0], table[:, column]


def windows() -> Iterator[Window]:
    for number, reference in CANTILEVER.items():
        coarse = 100 if number == 3 else 50
        for start_s, end_s, step in (*CUTS, (0.0, np.inf, coarse), (0.05, np.inf, 40)):
            load = partial(cantilever, number)
            cut: dict[str, Any] = {"start_s": start_s, "end_s": end_s, "step": step}
            yield Window(f"cantilever {number}", load, DECAY, "V", reference=reference, **cut)
    for start_s, end_s, step in WHEEL_CUTS:
        load = partial(wheel, "radial")
        yield Window("wheel", load, DECAY, "rad", "velocity", WHEEL, start_s, end_s, step)
    yield Window("wheel, axial", partial(wheel, "axial"), DECAY, "rad", "velocity")
    for number in (1, 2, 3, 4):
        load = partial(disc, f"molla_durissima_discopieno_14.91945_0.2016_{number}")
        for start_s, end_s in ((0.0, np.inf), (0.0, 40.0), (30.0, np.inf)):
            yield Window(f"disc {number}", load, DECAY, start_s=start_s, end_s=end_s)
    for spring in ("dura", "morbida"):
        yield Window(f"disc {spring}", partial(disc, f"molla_{spring}_discopieno_0.1223kg"), DECAY)
    yield Window("disc morbida 2", partial(disc, "molla_morbida_discopieno_0.1223kg_2"), DECAY)
    for file in ("Run_1-10_no_magnet(neat).csv", "set_2_dndo(full).csv"):
        for run in range(1, 11):
            yield Window(f"rotary {file} {run}", partial(rotary, file, run), DECAY, "rad")
    for run in (1, 2, 5, 7, 10, 11, 12, 14, 17, 20, 24, 27):
        yield Window(f"driven {run}", partial(rotary, "set_3_ddo(1)(full).csv", run), NO_DECAY, "rad")
    for column in (1, 2):
        for start_s in (0.0, 9.0):
            yield Window(f"damper {column}", partial(damper, column), TWO_MASSES, start_s=start_s)
    for day in ("2023-6-12-22-37", "2023-6-13-11-10", "2023-6-13-11-11", "2023-6-13-11-9", "2023-6-13-12-0"):
        for column in (3, 4):
            yield Window(f"carts {day} {column}", partial(carts, day, column), TWO_MASSES | {"stand"}, "cm")
    for hertz in ("1.407hz", "1.138hz_ricercarisonanza"):
        load = partial(disc, f"molla_dura_discopieno_battimenti_0.1419kg_frequenza_{hertz}")
        yield Window(f"disc driven {hertz}", load, NO_DECAY)


def is_inside(found: Quantity, reference: Range) -> bool:
    """Whether a value is in the range, or its interval overlaps it and is narrower than half of the value."""
    low, high = found.interval_95
    overlaps = low <= reference[1] and high >= reference[0] and high - low < 0.5 * abs(found.value)
    return reference[0] <= found.value <= reference[1] or overlaps


def judge(window: Window, folder: Path) -> tuple[str, bool | None, str]:
    """Degree, whether T, n and x_k are inside (None without a reference), and what was found."""
    time_s, value = window.load(folder)
    since_s = time_s - time_s[0]
    kept = (since_s >= window.start_s) & (since_s < window.end_s)
    record = single_channel(since_s[kept][:: window.step], value[kept][:: window.step])
    try:
        found = identify_one_mass(record, quantity=window.quantity, unit=window.unit)
    except AnalysisError as error:
        return REFUSED, None if window.reference is None else False, str(error)
    assert found.model is not None
    period, damping = found.results["period_s"], found.results["damping_n_per_s"]
    coulomb, reference, inside = found.results["coulomb_displacement_m"], window.reference, None
    if reference is not None:
        inside = is_inside(period, reference.period_s) and is_inside(damping, reference.damping_per_s)
        if reference.coulomb is not None:
            inside = inside and is_inside(coulomb, reference.coulomb)
        elif found.labels["coulomb_significant"]:
            inside = inside and coulomb.value < NO_COULOMB * float(np.ptp(value))
    told = ", ".join(
        f"{symbol} {each.value:.5g} ± {each.standard_uncertainty:.2g}"
        for symbol, each in (("T", period), ("n", damping), ("x_k", coulomb))
    )
    return found.model.degree.value, inside, told


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, help="with a clone of each repository")
    folder = parser.parse_args().folder
    right, inside = [], []
    for window in windows():
        degree, is_in, told = judge(window, folder)
        right.append(degree in window.degrees)
        inside += [] if is_in is None else [is_in]
        marks = ("  " if right[-1] else "! ") + {None: "    ", True: "in  ", False: "out "}[is_in]
        print(f"{marks}{window.name:44s} {degree:9s} {told}")
    print(f"{sum(inside)} of {len(inside)} inside their ranges, {sum(right)} of {len(right)} degrees")


if __name__ == "__main__":
    main()
