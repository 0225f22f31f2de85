"""Results of runs and rows of a table with known truth, for the tests of campaigns."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.rows import SeriesRow
from analysis.campaign.series import RunResult, SeriesKey
from analysis.quantities import BudgetLine, BudgetSource, Quantity
from config.files import load_stand, published_table

FRICTION, VELOCITY = "friction_dynamic", "table_velocity_max_m_per_s"


@cache
def key_of(code: str) -> SeriesKey:
    """Series of the shipped stand."""
    stand = load_stand()
    series = stand.series(code)
    return SeriesKey(code, series.contact, series.pullback_m, series.plate_mass_kg, stand.table_mass_kg)


def run(name: str, series: str | SeriesKey, values: dict[str, tuple[float, ...]], **fields) -> RunResult:
    """A run; each value with its own and its shared standard uncertainty."""
    key = key_of(series) if isinstance(series, str) else series
    results, budget = {}, []
    for quantity, (value, own, shared) in values.items():
        results[quantity] = Quantity.normal(value, math.hypot(own, shared), "1")
        budget += [
            BudgetLine(BudgetSource.NOISE, quantity, own),
            BudgetLine(BudgetSource.GAUGE_1_GAIN, quantity, shared),
        ]
    return RunResult(
        name, key, results, tuple(budget), calibration_id="A", stand_id="S", adequate=True, **fields
    )


def friction_run(
    name: str, series: str | SeriesKey, friction: float, own: float = 1e-4, **fields
) -> RunResult:
    """A run with f_d and v_max, both sharing a gain that is known to 0.3 %."""
    velocity = 0.2
    values = {FRICTION: (friction, own, 3e-3 * friction), VELOCITY: (velocity, 1e-5, 3e-3 * velocity)}
    return run(name, series, values, **fields)


def pooled(value: float, repeatable: float, common: dict[str, float], runs: int = 3) -> PooledQuantity:
    """A quantity of a series with repeats."""
    quantity = Quantity.normal(value, math.hypot(repeatable, *common.values()), "1")
    return PooledQuantity(quantity, runs, repeatable, common, 0.0, repeatable, 1.0, 2)


@cache
def velocities() -> dict[str, float]:
    """About the largest velocities of Table 1's rows, from pullback and period (m/s)."""
    stand = load_stand()
    return {
        code: 2.0 * math.pi / row.period_s * stand.series(code).pullback_m
        for code, row in published_table().items()
    }


def rows_with(log_friction, rng: np.random.Generator, *, own=5e-4, beyond=0.0, codes=None) -> list[SeriesRow]:
    """Rows of Table 1 whose ln f_d is `log_friction(key, velocity)` and errs as stated; the gain errs too."""
    gain, rows = 3e-3, []
    shift = gain * rng.standard_normal()
    for code, velocity in velocities().items():
        if codes is not None and code not in codes:
            continue
        key = key_of(code)
        error = shift + math.hypot(own, beyond) * rng.standard_normal()
        friction = math.exp(log_friction(key, velocity) + error)
        quantities = {
            FRICTION: pooled(friction, own * friction, {"gain": gain * friction}),
            VELOCITY: pooled(velocity, 1e-5, {"gain": gain * velocity}),
        }
        rows.append(SeriesRow(code, key, quantities, "IX", (code,)))
    return rows


def without_repeats(row: SeriesRow) -> SeriesRow:
    """The same row from one run."""
    single = {
        name: replace(one, runs=1, between_runs=None, scatter=None, birge_ratio=None, degrees_of_freedom=0)
        for name, one in row.quantities.items()
    }
    return replace(row, quantities=single)
