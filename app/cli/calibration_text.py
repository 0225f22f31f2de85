"""A calibration as a JSON object and as lines for people."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli import output as out

if TYPE_CHECKING:
    from analysis.calibration.calibrate import Calibration

_MERITS = (
    ("nonlinearity_m", "non-linearity"),
    ("hysteresis_m", "hysteresis"),
    ("repeatability_m", "repeatability"),
    ("zero_drift_m", "zero drift"),
)


def report(
    gauge: str, found: "Calibration", file: Path, kept: Path | None, *, use: bool, as_json: bool
) -> None:
    """Say what was found and where it is."""
    if as_json:
        out.emit_json(describe(gauge, found, file, kept, use))
        return
    _say_readings(found)
    _say_result(found)
    for caution in found.cautions:
        out.say(f"warning {caution.code}: {caution.message}")
    out.say(f"wrote {file}")
    if kept is not None:
        out.say(f"the calibration before it is kept as {kept}")
    if not use:
        out.say(f"take it with: slipstand record --calibration {file}, or calibrate with --use for all runs")


def describe(gauge: str, found: "Calibration", file: Path, kept: Path | None, used: bool) -> dict[str, Any]:
    """JSON object of a calibration."""
    from app.runs.described import describe as describe_quantity

    readings = found.readings
    rows = zip(
        readings.counts,
        readings.dial_m,
        readings.direction,
        readings.round_number,
        found.residual_m,
        strict=True,
    )
    return {
        "schema": "slipstand-calibration/1",
        "gauge": gauge,
        "file": str(file),
        "in_use": used,
        "kept": None if kept is None else str(kept),
        "gain_m_per_count": describe_quantity(found.gain_m_per_count),
        "gain_relative_standard_uncertainty": found.gain_relative_standard_uncertainty,
        "zero_count": describe_quantity(found.zero_count),
        "zero_standard_uncertainty_m": found.zero_standard_uncertainty_m,
        "polynomial": list(found.polynomial),
        "displacement_standard_uncertainty_m": found.displacement_standard_uncertainty_m,
        "scatter_m": found.scatter_m,
        **{name: getattr(found.merits, name) for name, _ in _MERITS},
        "budget": [
            {
                "source": line.source,
                "contribution_to": line.contribution_to,
                "standard_uncertainty": None
                if math.isnan(line.standard_uncertainty)
                else line.standard_uncertainty,
            }
            for line in found.budget
        ],
        "readings": [
            {
                "counts": float(counts), "dial_m": float(dial_m), "direction": "up" if way > 0 else "down",
                "round": int(number), "residual_m": float(left),
            }
            for counts, dial_m, way, number, left in rows
        ],
        "warnings": [{"code": caution.code, "message": caution.message} for caution in found.cautions],
    }  # fmt: skip


def _say_readings(found: "Calibration") -> None:
    readings, most_m = found.readings, float(max(abs(found.residual_m))) or 1.0
    out.table(
        ("round", "way", "dial (mm)", "counts", "residual (µm)", _scale(most_m)),
        [
            (
                str(readings.round_number[i]),
                "up" if readings.direction[i] > 0 else "down",
                f"{readings.dial_m[i] * 1e3:.4g}",
                f"{readings.counts[i]:.9g}",
                f"{found.residual_m[i] * 1e6:+.1f}",
                _mark(found.residual_m[i] / most_m, "^" if readings.direction[i] > 0 else "v"),
            )
            for i in range(len(readings))
        ],
    )


_HALF = 12


def _scale(most_m: float) -> str:
    """Head of the column in which the residuals are drawn, as wide as it."""
    end = f"{most_m * 1e6:.3g}"
    return f"{'-' + end:<{_HALF}}0{'+' + end:>{_HALF}}"


def _mark(share: float, mark: str) -> str:
    """Draw a residual as a mark on its side of the line, at its share of the largest one."""
    line = [" "] * _HALF + ["|"] + [" "] * _HALF
    line[_HALF + round(_HALF * share)] = mark
    return "".join(line)


def _say_result(found: "Calibration") -> None:
    gain, zero = found.gain_m_per_count, found.zero_count
    relative = found.gain_relative_standard_uncertainty
    out.say(f"gain           {gain.value:.7g} m/count, standard uncertainty {relative:.2g} of it")
    out.say(f"zero           {out.rounded(zero.value, zero.standard_uncertainty)} counts")
    if found.polynomial:
        terms = ", ".join(f"{term:.5g}" for term in found.polynomial)
        out.say(f"polynomial     {terms} (1/m, 1/m²)")
    for name, label in _MERITS:
        value_m = getattr(found.merits, name)
        out.say(f"{label:14} {'not known' if value_m is None else f'{value_m * 1e6:.1f} µm'}")
    whole_um = found.displacement_standard_uncertainty_m * 1e6
    out.say(f"displacement   standard uncertainty {whole_um:.1f} µm within the readings")
