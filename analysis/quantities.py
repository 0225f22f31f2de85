"""Quantities with standard uncertainty and 95 % interval, result warnings, and uncertainty budgets."""

from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, Self, TypeAlias

from analysis.formatting import format_value
from messages.i18n import N_
from messages.message import Message, message

COVERAGE_FACTOR_95 = 1.959963984540054  # coverage factor of a 95 % interval of a normal distribution
COVERAGE_FACTOR = 2.0
"""k of expanded uncertainties (JCGM 100, 6.2)."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A measured quantity."""

    value: float
    standard_uncertainty: float
    interval_95: tuple[float, float]  # 95 % coverage interval in `unit`, not necessarily symmetric
    unit: str  # "1" for pure numbers

    @classmethod
    def normal(cls, value: float, standard_uncertainty: float, unit: str) -> "Quantity":
        """Quantity with a normal distribution: 95 % lie within 1.959964 standard uncertainties."""
        half = COVERAGE_FACTOR_95 * standard_uncertainty
        return cls(value, standard_uncertainty, (value - half, value + half), unit)

    def __str__(self) -> str:
        """Value and standard uncertainty, rounded to two digits of it, in `unit`."""
        return str(format_value(self.value, self.standard_uncertainty, "" if self.unit == "1" else self.unit))

    @property
    def expanded_uncertainty(self) -> float:
        """U = k u with k = 2: a coverage of about 95 % where the distribution is normal."""
        return COVERAGE_FACTOR * self.standard_uncertainty


@dataclass(frozen=True, slots=True)
class ResultWarning:
    """A fact that limits the validity of a result."""

    code: str  # stable name, for programs
    message: Message


def result_warning(code: str, template: str, /, **values: Any) -> ResultWarning:
    """Warning with the message of `template` and `values`."""
    return ResultWarning(code, message(template, **values))


class SharedBy(Enum):
    """Which results have the error of a source in common."""

    NONE = "none"  # each result has an error of its own: repeats average it
    RUN = "run"  # all results of one run: repeats average it
    CALIBRATION = "calibration"
    SERIES = "series"
    STAND = "stand"


class BudgetSource(Enum):
    """Source of uncertainty. The value is its name in JSON and on screens."""

    NOISE = N_("noise"), SharedBy.NONE
    TABLE_MASS = N_("table mass")
    PLATE_MASS = N_("plate mass")
    MASS = N_("mass")
    GRAVITY = N_("gravity")
    TIME_BASE = N_("time base"), SharedBy.RUN  # the clock is timed in each run
    NOMINAL_RATE = N_("nominal rate")  # what a run that was timed badly takes of the device's nominal rate
    TIME_BASE_NOT_STATED = N_("time base (not stated)")
    LEVELLING = N_("levelling of the plane"), SharedBy.SERIES, True
    GAUGE_1_GAIN = N_("gauge 1 gain"), SharedBy.CALIBRATION
    GAUGE_2_GAIN = N_("gauge 2 gain"), SharedBy.CALIBRATION
    GAUGE_1_GAIN_NOT_STATED = N_("gauge 1 gain (not stated)"), SharedBy.CALIBRATION
    GAUGE_2_GAIN_NOT_STATED = N_("gauge 2 gain (not stated)"), SharedBy.CALIBRATION
    GAUGE_1_NONLINEARITY = N_("gauge 1 non-linearity"), SharedBy.CALIBRATION, True
    GAUGE_2_NONLINEARITY = N_("gauge 2 non-linearity"), SharedBy.CALIBRATION, True
    GAUGE_2_LAG = N_("lag of gauge 2"), SharedBy.CALIBRATION
    MODEL = N_("model"), SharedBy.SERIES  # what models leave unexplained, alike in repeats on one stand
    UNDIVIDED = N_("not broken down")  # the whole uncertainty of a quantity that has no budget
    READINGS = N_("readings"), SharedBy.NONE
    DIAL_GAUGE = N_("dial gauge")
    ZERO_DRIFT = N_("zero drift")
    NONLINEARITY = N_("non-linearity and hysteresis")
    REPEATABILITY = N_("repeatability")
    CALIBRATION_GAIN = N_("gain of the calibration")
    KNOWN_DISPLACEMENT = N_("known displacement")

    shared_by: SharedBy
    is_rectangular: bool  # the error has a rectangular distribution instead of a normal one

    def __new__(cls, name: str, shared_by: SharedBy = SharedBy.STAND, is_rectangular: bool = False) -> Self:
        member = object.__new__(cls)
        member._value_ = name
        member.shared_by = shared_by
        member.is_rectangular = is_rectangular
        return member

    @property
    def label(self) -> Message:
        return Message(self.value)

    def __str__(self) -> str:
        return str(self.value)


@dataclass(frozen=True, slots=True)
class OtherLaw:
    """The chance that the friction law `law` is true, not the chosen one: a source of uncertainty."""

    shared_by: ClassVar = SharedBy.NONE
    is_rectangular: ClassVar = False
    law: str

    @property
    def label(self) -> Message:
        return message(_OTHER_LAW, law=self.law)

    def __str__(self) -> str:
        return str(self.label)


_OTHER_LAW = N_("law may be {law}")
Source: TypeAlias = BudgetSource | OtherLaw


def parse_source(name: str) -> Source:
    """Source of a name in JSON. Raises ValueError for a name that no version has written."""
    if name in _SOURCES:
        return _SOURCES[name]
    beginning = _OTHER_LAW.partition("{")[0]
    if not name.startswith(beginning):
        raise ValueError(f"{name!r} is no source of uncertainty")
    return OtherLaw(name.removeprefix(beginning))


_SOURCES = {source.value: source for source in BudgetSource}


@dataclass(frozen=True, slots=True)
class BudgetLine:
    """Contribution of one source to the standard uncertainty of one result."""

    source: Source
    contribution_to: str
    standard_uncertainty: float  # in the unit of the result; NaN where it matters but is not stated
