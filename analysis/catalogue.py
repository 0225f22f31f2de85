"""The catalogue of quantities: name, symbol, units and description of every result, one row each.

The window, the command line, the campaign's table, reports, exports and LaTeX read it. A new result is one
row; with `column` it is also a column of the campaign's table.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from analysis.formatting import FormattedValue, format_fixed, format_value
from analysis.quantities import Quantity
from messages.i18n import N_


class Place(Enum):
    """Where a quantity is shown, as far as its unit depends on it."""

    WINDOW = "window"
    TERMINAL = "terminal"  # lines of the command line, and the LaTeX export of single runs
    TABLE = "table"  # the campaign's table, in all formats
    REPORT = "report"


@dataclass(frozen=True, slots=True)
class Symbol:
    """Symbol of the paper: a letter, and an index as subscript."""

    letter: str
    index: str = ""
    ascii: str = ""  # what a terminal shows in place of letter and index where those are not ASCII
    relation: str = ""  # ≥ or ≤ where the quantity is a bound, else ""

    @property
    def text(self) -> str:
        """`f_d`, `n1`: an index that is a number joins the letter."""
        joint = "" if self.index.isdigit() else "_"
        return self.ascii or (f"{self.letter}{joint}{self.index}" if self.index else self.letter)

    @property
    def markup(self) -> str:
        """`f_d`, `n_1`: letter and index as the report's template reads them."""
        return f"{self.letter}_{self.index}" if self.index else self.letter

    @property
    def plain(self) -> str:
        """`f_d`, `n₁`: for places without markup but with all of Unicode."""
        return f"{self.letter}{self.index.translate(_SUBSCRIPTS)}" if self.index.isdigit() else self.markup

    @property
    def html(self) -> str:
        """`f<sub>d</sub>`, with the relation of a bound."""
        symbol = f"{self.letter}<sub>{self.index}</sub>" if self.index else self.letter
        return f"{symbol} {self.relation}".rstrip()

    @property
    def latex(self) -> str:
        """`$f_d$`."""
        letter = _LATEX_LETTERS.get(self.letter, self.letter)
        if not self.index:
            return f"${letter}$"
        index = self.index if len(self.index) == 1 else rf"{{\mathrm{{{self.index}}}}}"
        return f"${letter}_{index}$"


_SUBSCRIPTS: Final = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_LATEX_LETTERS: Final = {
    "δ": r"\delta",
    "μ": r"\mu",
    "α": r"\alpha",
    "ζ": r"\zeta",
    "η": r"\eta",
    "κ": r"\kappa",
}


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit in which a quantity is shown."""

    symbol: str  # "" for pure numbers
    scale: float = 1.0  # number of these units in one SI unit
    latex: str = ""  # symbol in LaTeX, where it differs

    @property
    def in_latex(self) -> str:
        return self.latex or self.symbol

    def number(self, value: float, decimals: int) -> str:
        """Write an SI value in this unit with fixed decimals: `12.30`; a dash for NaN."""
        return format_fixed(self.scale * value, decimals) if math.isfinite(value) else "–"

    def text(self, value: float, decimals: int) -> str:
        """Write an SI value with this unit: `12.30 mm`."""
        return f"{self.number(value, decimals)} {self.symbol}"

    def labelled(self, name: str) -> str:
        return f"{name} ({self.symbol})"


@dataclass(frozen=True, slots=True)
class TableColumn:
    """Column of a quantity in the campaign's table."""

    position: int  # in the paper's Table 1, from 1; columns of our own follow
    published: str = ""  # attribute of a published row; "" where the paper does not print the quantity
    is_proportional: bool = True  # runs differ by a share of the value rather than by an amount
    is_of_stand: bool = False  # a property of the stand: its scatter does not depend on the contact
    missing: str = ""  # reason why no run may have determined it
    is_optional: bool = False  # shown only where asked for


@dataclass(frozen=True, slots=True)
class QuantityDefinition:
    """One row of the catalogue."""

    name: str  # key in JSON, with the SI unit
    symbol: Symbol
    unit: str  # SI, as in JSON; "1" for pure numbers
    description: str  # a few words for people; English, marked for translation
    display: Unit
    display_at: dict[Place, Unit] = field(default_factory=dict)  # other units, by place
    column: TableColumn | None = None  # None for quantities that the campaign's table does not hold
    is_minor: bool = False  # in reports; window and terminal give it no row of its own

    def unit_at(self, place: Place, unit: str = "") -> Unit:
        """Unit shown at a place; a `unit` other than that of the catalogue is shown as it is.

        Readings of one mass may be in rad or V.
        """
        if unit and unit != self.unit:
            return Unit(unit)
        if place is Place.WINDOW and self.display is MILLIMETRE:
            return displacement_unit()
        return self.display_at.get(place, self.display)

    def format(self, quantity: Quantity, place: Place) -> FormattedValue:
        """Value and uncertainty to the same digit, in the unit of the place."""
        unit = self.unit_at(place, quantity.unit)
        return format_value(
            quantity.value * unit.scale, quantity.standard_uncertainty * unit.scale, unit.symbol
        )

    def latex_heading(self, place: Place) -> str:
        """Symbol and unit of a column in LaTeX: `$u_s$, mm`."""
        return ", ".join(filter(None, (self.symbol.latex, self.unit_at(place).in_latex)))

    def heading(self, place: Place) -> str:
        """Symbol and unit of a column: `u_s mm`."""
        return f"{self.symbol.text} {self.unit_at(place).symbol}".rstrip()


_NUMBER = Unit("")
_PERCENT = Unit("%", 1e2, r"\%")
MICROMETRE = Unit("µm", 1e6)
MILLIMETRE = Unit("mm", 1e3)
MILLISECOND = Unit("ms", 1e3)
SECOND = Unit("s")
MILLIRADIAN = Unit("mrad", 1e3)
PER_SECOND = Unit("1/s", latex="s$^{-1}$")
_RADIANS_PER_SECOND = Unit("rad/s", latex="s$^{-1}$")
MILLIMETRES_PER_SECOND = Unit("mm/s", 1e3)
METRES_PER_SECOND = Unit("m/s")
KILOGRAM = Unit("kg")
ACCELERATION = Unit("m/s²", latex="m/s$^2$")
_IN_METRES = {Place.TABLE: METRES_PER_SECOND, Place.REPORT: METRES_PER_SECOND}

DISPLACEMENT_UNITS: Final = {"mm": MILLIMETRE, "um": MICROMETRE}
"""Units that the window may show displacements in, by their names in the settings."""
_displacement_unit = MILLIMETRE


def use_displacement_unit(unit: Unit) -> None:
    """Show displacements in a unit on screens from now on; files, reports and terminals keep mm.

    Only the window calls it, in each process in which it formats numbers.
    """
    global _displacement_unit  # noqa: PLW0603 - as the language: one unit a process
    _displacement_unit = unit


def displacement_unit() -> Unit:
    """Unit of displacements on screens."""
    return _displacement_unit


def displacement_decimals(decimals: int) -> int:
    """Decimals on screens of a displacement that has so many `decimals` in millimetres."""
    return max(decimals - round(math.log10(_displacement_unit.scale / MILLIMETRE.scale)), 0)


_Row = QuantityDefinition
CATALOGUE: Final = (
    _Row("friction_dynamic", Symbol("f", "d"), "1", N_("dynamic friction"), _NUMBER,
         column=TableColumn(8, "friction_dynamic",
                            missing=N_("Nothing slipped, or no law could be fitted: f_d is not known."))),
    _Row("friction_dynamic_plate", Symbol("f", "dp"), "1", N_("dynamic friction, from the plate alone"),
         _NUMBER, column=TableColumn(11, is_optional=True, missing=N_("Too few slips, or no second gauge."))),
    _Row("friction_path_mean", Symbol("f", "m"), "1", N_("mean friction over the slid path"), _NUMBER),
    _Row("friction_static", Symbol("f", "s"), "1", N_("static friction"), _NUMBER,
         column=TableColumn(7, "friction_static", missing=N_("No stick ended in a slip: f_s has no value."))),
    _Row("friction_static_lower", Symbol("f", "s", relation="≥"), "1", N_("static friction, at least"),
         _NUMBER),
    _Row("friction_static_upper", Symbol("f", "s", relation="≤"), "1", N_("static friction, at most"),
         _NUMBER),
    _Row("stribeck_velocity_m_per_s", Symbol("v", "s"), "m/s", N_("Stribeck velocity"),
         MILLIMETRES_PER_SECOND),
    _Row("release_ramp_s", Symbol("t", "r"), "s",
         N_("time of release"), MILLISECOND),
    _Row("release_step", Symbol("q", "r"), "1",
         N_("share of the hook's force that it loses at once"), _NUMBER),
    _Row("release_shape", Symbol("p", "r"), "1",
         N_("shape of the release"), _NUMBER),
    _Row("release_velocity_m_per_s", Symbol("v", "0"), "m/s",
         N_("velocity at the release"), MILLIMETRES_PER_SECOND),
    _Row("hold_creep_m_per_s", Symbol("v", "h"), "m/s",
         N_("velocity of the hold"), MILLIMETRES_PER_SECOND),
    _Row("gauge_2_lag_s", Symbol("t", "2"), "s",
         N_("lag of gauge 2"), MILLISECOND),
    _Row("relative_gain", Symbol("g", "2"), "1",
         N_("relative gain error of gauge 2"), _PERCENT),
    _Row("spring_hardening", Symbol("c", "3"), "1",
         N_("hardening of the springs at the pullback"), _PERCENT),
    _Row("spring_asymmetry", Symbol("c", "2"), "1",
         N_("asymmetry of the springs at the pullback"), _PERCENT),
    _Row("stand_friction_m", Symbol("x", "s"), "m",
         N_("friction of the stand"), MICROMETRE),
    _Row("drag_per_m", Symbol("d"), "1/m",
         N_("quadratic damping of the stand"), Unit("1/m")),
    _Row("damping_rise", Symbol("r", "n"), "1",
         N_("rise of the damping at the first swing"), _PERCENT),
    _Row("loss_factor", Symbol("η", ascii="loss factor"), "1",
         N_("loss factor of the springs"), _NUMBER),
    _Row("arc_per_m", Symbol("κ", ascii="arc"), "1/m",
         N_("curvature of the table's path"), Unit("1/m")),
    _Row("second_mode_mass_share", Symbol("m", "3"), "1",
         N_("mass of the second mode over the table's"), _PERCENT),
    _Row("second_mode_frequency_hz", Symbol("f", "3"), "Hz",
         N_("frequency of the second mode"), Unit("Hz")),
    _Row("second_mode_damping", Symbol("ζ", "3", ascii="zeta3"), "1",
         N_("damping ratio of the second mode"), _NUMBER),
    _Row("film_s_per_m", Symbol("b", "f"), "s/m",
         N_("relative rise of friction with velocity"), Unit("s/m")),
    _Row("friction_per_log_velocity", Symbol("b", "l"), "1",
         N_("relative rise of friction with the logarithm of velocity"), _NUMBER),
    _Row("friction_gradient_per_m", Symbol("b", "x"), "1/m",
         N_("relative rise of friction along the track"), Unit("%/mm", 0.1)),
    _Row("friction_wear_per_m", Symbol("b", "p"), "1/m",
         N_("relative rise of friction with the slid path"), Unit("%/mm", 0.1)),
    _Row("friction_asymmetry", Symbol("b", "s"), "1",
         N_("relative difference of friction by direction"), _PERCENT),
    _Row("friction_per_log_dwell", Symbol("b", "t"), "1",
         N_("relative rise of static friction with the logarithm of the time of stick"), _NUMBER),
    _Row("presliding_m", Symbol("z", "p"), "m", N_("deflection at which the contact slides"), MICROMETRE),
    _Row("gauge_1_creep_m", Symbol("z", "1"), "m", N_("creep of the zero of gauge 1"), MICROMETRE),
    _Row("gauge_1_creep_time_s", Symbol("τ", "1", ascii="tau1"), "s",
         N_("time constant of the creep of gauge 1"), SECOND),
    _Row("gauge_2_creep_m", Symbol("z", "2"), "m", N_("creep of the zero of gauge 2"), MICROMETRE),
    _Row("gauge_2_creep_time_s", Symbol("τ", "2", ascii="tau2"), "s",
         N_("time constant of the creep of gauge 2"), SECOND),
    _Row("gauge_filter_hz", Symbol("f", "c"), "Hz",
         N_("corner frequency of the filter of both gauges"), Unit("Hz")),
    _Row("gauge_2_filter_hz", Symbol("f", "c2"), "Hz",
         N_("corner frequency of the filter of gauge 2"), Unit("Hz")),
    _Row("gauge_1_square", Symbol("s", "1"), "1", N_("even bend of gauge 1 at the pullback"), _PERCENT),
    _Row("gauge_2_square", Symbol("s", "2"), "1", N_("even bend of gauge 2 at the pullback"), _PERCENT),
    _Row("cross_talk_1", Symbol("k", "21"), "1", N_("share of gauge 2 in gauge 1"), _PERCENT),
    _Row("base_compliance", Symbol("c", "b"), "1", N_("stiffness of the springs over that under the base"),
         _PERCENT),
    _Row("base_frequency_hz", Symbol("f", "b"), "Hz", N_("frequency of the base"), Unit("Hz")),
    _Row("base_damping", Symbol("ζ", "b", ascii="zetab"), "1",
         N_("damping ratio of the base"), _NUMBER),
    _Row("filter_damping", Symbol("ζ", "f", ascii="damping of filter"), "1",
         N_("damping ratio of the filter less 1"), _NUMBER),
    _Row("gauge_1_bend", Symbol("b", "1"), "1",
         N_("bend of gauge 1 at the pullback"), _PERCENT),
    _Row("gauge_2_bend", Symbol("b", "2"), "1",
         N_("bend of gauge 2 at the pullback"), _PERCENT),
    _Row("cross_talk", Symbol("k", "12"), "1",
         N_("share of gauge 1 in gauge 2"), _PERCENT),
    _Row("tilt_rad", Symbol("α", ascii="tilt"), "rad", N_("tilt"), MILLIRADIAN),
    _Row("period_s", Symbol("T"), "s", N_("period"), MILLISECOND, {Place.TABLE: SECOND},
         column=TableColumn(3, "period_s", is_of_stand=True)),
    _Row("log_decrement", Symbol("δ", ascii="log decrement"), "1", N_("log decrement"), _NUMBER),
    _Row("log_decrement_classical", Symbol("δ", "c", ascii="log decrement of turning points"), "1",
         N_("log decrement of the turning points"), _NUMBER, is_minor=True),
    _Row("damping_n1_per_s", Symbol("n", "1"), "1/s", N_("damping"), PER_SECOND,
         column=TableColumn(5, "damping_n1_per_s", is_of_stand=True)),
    _Row("damping_n2_per_s", Symbol("n", "2"), "1/s", N_("damping, table alone"), PER_SECOND,
         column=TableColumn(6, "damping_n2_per_s", is_of_stand=True)),
    _Row("damping_n_per_s", Symbol("n"), "1/s", N_("damping"), PER_SECOND),
    _Row("damping_mean_per_s", Symbol("n", "m"), "1/s", N_("mean damping of the record"), PER_SECOND),
    _Row("stiffness_n_per_m", Symbol("c"), "N/m", N_("stiffness"), Unit("N/m"),
         {Place.WINDOW: Unit("kN/m", 1e-3)}, column=TableColumn(2, "stiffness_as_printed", is_of_stand=True)),
    _Row("damping_coefficient_kg_per_s", Symbol("μ", ascii="mu"), "kg/s", N_("damping coefficient"),
         Unit("kg/s")),
    _Row("frequency_k1_rad_per_s", Symbol("k", "1"), "rad/s", N_("circular frequency"), _RADIANS_PER_SECOND,
         is_minor=True),
    _Row("frequency_k2_rad_per_s", Symbol("k", "2"), "rad/s", N_("circular frequency, table alone"),
         _RADIANS_PER_SECOND, is_minor=True),
    _Row("frequency_k_rad_per_s", Symbol("k"), "rad/s", N_("circular frequency"), _RADIANS_PER_SECOND,
         is_minor=True),
    _Row("damping_ratio", Symbol("ζ", ascii="damping ratio"), "1", N_("damping ratio"), _NUMBER,
         is_minor=True),
    _Row("pullback_m", Symbol("u", "0"), "m", N_("pullback"), MILLIMETRE),
    _Row("residual_displacement_m", Symbol("u", "s"), "m", N_("residual displacement"), MILLIMETRE,
         column=TableColumn(4, "residual_displacement_m", is_proportional=False,
                            missing=N_("Slip had not ended when the record did: u_s is not known."))),
    _Row("coulomb_displacement_m", Symbol("x", "k"), "m", N_("Coulomb displacement"), MILLIMETRE),
    _Row("table_velocity_max_m_per_s", Symbol("v", "max"), "m/s", N_("table velocity"),
         MILLIMETRES_PER_SECOND, _IN_METRES, column=TableColumn(9, "velocity_max_m_per_s")),
    _Row("plate_velocity_max_m_per_s", Symbol("v", "2"), "m/s", N_("plate velocity"), MILLIMETRES_PER_SECOND,
         _IN_METRES, is_minor=True),
    _Row("table_acceleration_max_m_per_s2", Symbol("a", "max"), "m/s2", N_("table acceleration"),
         ACCELERATION, column=TableColumn(10, "acceleration_max_m_per_s2")),
    _Row("plate_acceleration_max_m_per_s2", Symbol("a", "2"), "m/s2", N_("plate acceleration"), ACCELERATION,
         is_minor=True),
    _Row("plate_mass_kg", Symbol("m", "2"), "kg", N_("plate mass"), KILOGRAM,
         column=TableColumn(1, "plate_mass_kg"), is_minor=True),
)  # fmt: skip
"""Every quantity that an analysis finds, in the order of reports."""


def reading_units(unit: str) -> tuple[Unit, Unit]:
    """Units in which readings in `unit` and their residuals are drawn: metres as mm and µm."""
    return (MILLIMETRE, MICROMETRE) if unit == "m" else (Unit(unit), Unit(unit))


def reading_units_on_screen(unit: str) -> tuple[Unit, Unit]:
    """Units in which the window draws readings in `unit` and their residuals."""
    return (displacement_unit(), MICROMETRE) if unit == "m" else reading_units(unit)


def definition(name: str) -> QuantityDefinition:
    """Row of a quantity. Raises KeyError for a name that the catalogue does not hold."""
    for row in CATALOGUE:
        if row.name == name:
            return row
    raise KeyError(name)


def optional_columns() -> tuple[str, ...]:
    """Names of the columns that the table shows only where they are asked for."""
    return tuple(row.name for row in CATALOGUE if row.column is not None and row.column.is_optional)


def table_columns(optional: Collection[str] = ()) -> tuple[tuple[QuantityDefinition, TableColumn], ...]:
    """Quantities of the campaign's table with their rules, in the paper's order, then those of `optional`."""
    columns = [
        (row, row.column)
        for row in CATALOGUE
        if row.column is not None and (not row.column.is_optional or row.name in optional)
    ]
    return tuple(sorted(columns, key=lambda pair: pair[1].position))
