"""A number that can be signed: value, standard uncertainty, 95 % interval, unit."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Quantity:
    """A measured quantity.

    Attributes
    ----------
    value, standard_uncertainty : float
        In `unit`.
    interval_95 : (float, float)
        95 % coverage interval in `unit`, not necessarily symmetric.
    unit : str
        "1" for pure numbers.
    """

    value: float
    standard_uncertainty: float
    interval_95: tuple[float, float]
    unit: str

    @classmethod
    def normal(cls, value: float, standard_uncertainty: float, unit: str) -> "Quantity":
        """Quantity with a normal distribution: 95 % lie within 1.959964 standard uncertainties."""
        half = 1.959963984540054 * standard_uncertainty
        return cls(value, standard_uncertainty, (value - half, value + half), unit)


@dataclass(frozen=True, slots=True)
class ResultWarning:
    """Something that the reader of a result must know. `code` is stable, `message` is for people."""

    code: str
    message: str


@dataclass(frozen=True, slots=True)
class BudgetLine:
    """One source's share of the standard uncertainty of one result (same unit as that result).

    NaN where the source is known to matter but its uncertainty is not stated.
    """

    source: str
    contribution_to: str
    standard_uncertainty: float
