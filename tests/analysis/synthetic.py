"""Records of known truth, of the rows of Table 1."""

import csv
from pathlib import Path

from analysis.record import GaugeUncertainty
from analysis.synthetic import Truth, simulate_readings, simulate_record

__all__ = [
    "CALIBRATED",
    "TABLE_1",
    "Truth",
    "simulate_readings",
    "simulate_record",
    "table_1",
    "table_1_by_series",
]

TABLE_1 = Path(__file__).resolve().parents[2] / "config" / "table1.csv"
PULLBACKS_M = {"1": 0.012, "2": 0.009, "3": 0.006}
CALIBRATED = GaugeUncertainty(gain_relative=0.003, nonlinearity_m=5e-6, delay_s_uncertainty=2e-5)


def table_1() -> list[Truth]:
    """The 36 series of the paper's Table 1 with f_s = f_d."""
    return [truth for _, truth in table_1_by_series()]


def table_1_by_series() -> list[tuple[str, Truth]]:
    with TABLE_1.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    return [(row["series"], _of_row(row)) for row in rows]


def _of_row(row: dict[str, str]) -> Truth:
    return Truth(
        period_s=float(row["period_s"]),
        damping_n1_per_s=float(row["damping_n1_per_s"]),
        plate_mass_kg=float(row["plate_mass_kg"]),
        friction_dynamic=float(row["friction_dynamic"]),
        pullback_m=PULLBACKS_M[row["series"][0]],
    )
