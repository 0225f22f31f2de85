"""Check of a calibration against a known displacement."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from analysis.calibration.points import CalibrationError
from analysis.quantities import BudgetLine, BudgetSource, ResultWarning, result_warning
from messages.i18n import N_

COVERAGE: Final = 2.0  # tolerance over the combined standard uncertainty: about 95 % (JCGM 100, 6.3)
_BLUNT: Final = 0.05  # a tolerance above this share passes errors of a gain that matter for f_d
_UNMOVED: Final = 0.02  # share of the displacement below which a gauge was not moved: no gain is so wrong
_BOTH_ENDS: Final = math.sqrt(2.0)
_SQRT12: Final = math.sqrt(12.0)


@dataclass(frozen=True, slots=True)
class MeanReading:
    """Mean reading of a gauge at rest."""

    displacement_m: float
    noise_m: float  # standard deviation of one sample (m)
    samples: int
    creep_m: float = 0.0  # mean of the second half minus that of the first (m)

    @property
    def standard_uncertainty_m(self) -> float:
        """Of the mean: noise, and creep with a rectangular distribution."""
        return math.hypot(self.noise_m / math.sqrt(self.samples), self.creep_m / _SQRT12)


@dataclass(frozen=True, slots=True)
class CalibrationClaim:
    """Stated uncertainties of a calibration; None is "not stated"."""

    gain_relative: float | None = None
    nonlinearity_m: float | None = None  # largest deviation from the curve (m)
    repeatability_m: float | None = None


@dataclass(frozen=True, slots=True)
class ReferenceDisplacement:
    """Known displacement, or the one that a shunt resistor simulates."""

    displacement_m: float  # with its sign (m)
    standard_uncertainty_m: float | None = None
    is_electric: bool = False  # a shunt: non-linearity and repeatability do not contribute

    def __post_init__(self) -> None:
        if not math.isfinite(self.displacement_m) or self.displacement_m == 0.0:
            raise CalibrationError(
                "a displacement of {displacement_m:g} m checks nothing. Give a finite one that is not 0",
                displacement_m=self.displacement_m,
            )
        stated = self.standard_uncertainty_m
        if stated is not None and not 0.0 <= stated < math.inf:
            raise CalibrationError(
                "uncertainty {stated:g} m must be a finite number, 0 or above", stated=stated
            )


@dataclass(frozen=True, slots=True)
class DisplacementCheck:
    """Result of the check."""

    expected_m: float  # known displacement, and that of the gauge: its reading there minus the one at rest
    measured_m: float
    standard_uncertainty_m: float  # combined, of their difference, from stated sources (m)
    budget: tuple[BudgetLine, ...]  # of `measured_m` minus `expected_m` (m); NaN where not stated
    warnings: tuple[ResultWarning, ...]

    @property
    def deviation_m(self) -> float:
        return self.measured_m - self.expected_m

    @property
    def tolerance_m(self) -> float:
        return COVERAGE * self.standard_uncertainty_m

    @property
    def passed(self) -> bool:
        return abs(self.deviation_m) <= self.tolerance_m


def check_displacement(
    rest: MeanReading, moved: MeanReading, reference: ReferenceDisplacement, claim: CalibrationClaim
) -> DisplacementCheck:
    """Compare the difference of two readings with a known displacement.

    Zero and rest position cancel: only the gain is checked. Raises CalibrationError for readings that are not
    finite, of too few samples, or the same.
    """
    for reading in (rest, moved):
        if not math.isfinite(reading.displacement_m) or reading.samples < 2:
            raise CalibrationError(
                "a reading of {displacement_m:g} m from {samples} samples is none. Check"
                " cable, power and range of the gauge, and read it again",
                displacement_m=reading.displacement_m,
                samples=reading.samples,
            )
    measured_m = moved.displacement_m - rest.displacement_m
    if abs(measured_m) < _UNMOVED * abs(reference.displacement_m):
        raise CalibrationError(
            "the gauge shows {measured_mm:+.4f} mm of {known_mm:+g} mm: it was not moved, or it does not"
            " read. Nothing is kept. Move it and check it again",
            measured_mm=measured_m * 1e3,
            known_mm=reference.displacement_m * 1e3,
        )
    budget = _budget(rest, moved, reference, claim)
    stated = [line.standard_uncertainty for line in budget if not math.isnan(line.standard_uncertainty)]
    combined_m = math.hypot(*stated)
    return DisplacementCheck(
        reference.displacement_m,
        measured_m,
        combined_m,
        budget,
        tuple(_warnings(reference, measured_m, combined_m, budget)),
    )


def _budget(
    rest: MeanReading, moved: MeanReading, reference: ReferenceDisplacement, claim: CalibrationClaim
) -> tuple[BudgetLine, ...]:
    gain = math.nan if claim.gain_relative is None else claim.gain_relative
    known_m = math.nan if reference.standard_uncertainty_m is None else reference.standard_uncertainty_m
    sizes_m = {
        BudgetSource.CALIBRATION_GAIN: gain * abs(reference.displacement_m),
        BudgetSource.KNOWN_DISPLACEMENT: known_m,
        BudgetSource.READINGS: math.hypot(rest.standard_uncertainty_m, moved.standard_uncertainty_m),
    }
    if not reference.is_electric:
        nonlinearity_m = (claim.nonlinearity_m or 0.0) / math.sqrt(3.0)
        sizes_m[BudgetSource.NONLINEARITY] = _BOTH_ENDS * nonlinearity_m
        sizes_m[BudgetSource.REPEATABILITY] = _BOTH_ENDS * (claim.repeatability_m or 0.0)
    return tuple(BudgetLine(source, "measured_m", size_m) for source, size_m in sizes_m.items())


def _warnings(
    reference: ReferenceDisplacement, measured_m: float, combined_m: float, budget: tuple[BudgetLine, ...]
) -> Iterator[ResultWarning]:
    for line in budget:
        if math.isnan(line.standard_uncertainty):
            template = N_("the uncertainty of the {source} is not stated and not counted.")
            yield result_warning("not-stated", template, source=line.source.label)
    share = COVERAGE * combined_m / abs(reference.displacement_m)
    if share > _BLUNT:
        template = N_(
            "an error of {share:.0%} would pass. Take a larger displacement, or a more certain one."
        )
        yield result_warning("check-blunt", template, share=share)
    if measured_m * reference.displacement_m < 0.0:
        yield result_warning(
            "other-way",
            "the gauge shows a displacement to the other side. Check its direction, its plugs"
            " and the sign that was given.",
        )
