"""What a campaign takes: the result of one run, and the series that it belongs to."""

from dataclasses import dataclass

from analysis.quantities import BudgetLine, Quantity, ResultWarning


@dataclass(frozen=True, slots=True)
class SeriesKey:
    """What is the same in all repeats of a series.

    Attributes
    ----------
    code : str
        As in the paper, for example "1FFM0"; "" for runs without a series.
    contact : str
        Code of what rubs on what, for example "FF", or any other name; "" where it is not known.
    pullback_m : float or None
        Nominal; None where it is not known.
    plate_mass_kg, table_mass_kg : float
        m2 with its added mass, and m1.
    """

    code: str
    contact: str
    pullback_m: float | None
    plate_mass_kg: float
    table_mass_kg: float

    @property
    def label(self) -> str:
        """The code, or else contact, pullback and plate mass: `PTFE 12 mm 22.4 kg`."""
        if self.code:
            return self.code
        pullback = "pullback unknown" if self.pullback_m is None else f"{self.pullback_m * 1e3:g} mm"
        return f"{self.contact or 'contact unknown'} {pullback} {self.plate_mass_kg:g} kg"

    @property
    def sort_key(self) -> tuple[bool, str, float, float, float, str]:
        """Sorts as the paper's table does: by contact, pullback from large to small, then plate mass."""
        pullback = 0.0 if self.pullback_m is None else self.pullback_m
        return (
            not self.contact,
            self.contact,
            -pullback,
            self.plate_mass_kg,
            self.table_mass_kg,
            self.code,
        )


@dataclass(frozen=True, eq=False, slots=True)
class RunResult:
    """What a campaign takes of one run.

    Attributes
    ----------
    name : str
        Path or label of the run.
    series : SeriesKey
    results : dict of Quantity
        By the names of INTERFACE; what could not be determined is absent. `plate_mass_kg` may be among them.
    budget : tuple of BudgetLine
        All lines of all results.
    calibration : str
        Identity of the gauges' calibrations: runs with the same one share its errors.
    stand : str
        Identity of the stand: runs with the same one share the errors of its masses, gravity and clock.
    adequate : bool or None
        Whether the friction law explains the record; None where no law was fitted.
    msk64_degree : str
        "" where it is not known.
    excluded : str
        Why the run does not count; "" when it does.
    cautions : tuple of Caution
        What was said of this run.
    """

    name: str
    series: SeriesKey
    results: dict[str, Quantity]
    budget: tuple[BudgetLine, ...] = ()
    calibration_id: str = ""
    stand_id: str = ""
    adequate: bool | None = None
    msk64_degree: str = ""
    excluded: str = ""
    warnings: tuple[ResultWarning, ...] = ()
