"""Columns of the paper's Table 1, in its order."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Column:
    """A quantity of the table.

    Attributes
    ----------
    name : str
        In the results of a run.
    symbol, unit : str
        As in the paper; the unit of the value, SI.
    published : str
        Attribute of a published row.
    proportional : bool
        Whether what differs from run to run is a share of the value rather than an amount.
    of_stand : bool
        Whether it is a property of the stand, so that its scatter is that of the stand whatever rubs on it.
    """

    name: str
    symbol: str
    unit: str
    published: str
    proportional: bool = True
    of_stand: bool = False


COLUMNS: Final = (
    Column("plate_mass_kg", "m2", "kg", "plate_mass_kg"),
    Column("stiffness_n_per_m", "c", "N/m", "stiffness_as_printed", of_stand=True),
    Column("period_s", "T", "s", "period_s", of_stand=True),
    Column("residual_displacement_m", "u_s", "m", "residual_displacement_m", proportional=False),
    Column("damping_n1_per_s", "n1", "1/s", "damping_n1_per_s", of_stand=True),
    Column("damping_n2_per_s", "n2", "1/s", "damping_n2_per_s", of_stand=True),
    Column("friction_static", "f_s", "1", "friction_static"),
    Column("friction_dynamic", "f_d", "1", "friction_dynamic"),
    Column("table_velocity_max_m_per_s", "v_max", "m/s", "velocity_max_m_per_s"),
    Column("table_acceleration_max_m_per_s2", "a_max", "m/s2", "acceleration_max_m_per_s2"),
)
