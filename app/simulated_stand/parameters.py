"""The chosen series, with what the options change, as parameters of the motion."""

from analysis.motion.two_mass import stiffness_and_damping
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import StandTruth
from config.files import published_row
from config.schema import Stand


def stand_truth(options: SimulatedStandOptions, stand: Stand) -> StandTruth:
    """Parameters of the chosen series, with what the options change.

    Raises
    ------
    ConfigError
        If the series is not one of the stand or has no row in Table 1.
    """
    series = stand.series(options.series)
    row = published_row(series.code)
    friction = _or(options.friction, row.friction_dynamic)
    stiffness, damping = stiffness_and_damping(
        row.period_s,
        row.damping_n1_per_s,
        table_mass_kg=stand.table_mass_kg,
        plate_mass_kg=series.plate_mass_kg,
    )
    return StandTruth(
        series=series.code,
        friction_dynamic=friction,
        friction_static=_or(options.static_friction, friction),
        tilt_rad=options.tilt_rad,
        pullback_m=_or(options.pullback_m, series.pullback_m),
        table_mass_kg=stand.table_mass_kg,
        plate_mass_kg=series.plate_mass_kg,
        gravity_m_per_s2=stand.gravity_m_per_s2,
        period_s=row.period_s,
        damping_n1_per_s=row.damping_n1_per_s,
        stiffness_n_per_m=stiffness,
        damping_coefficient_kg_per_s=damping,
    )


def _or(chosen: float | None, usual: float) -> float:
    return usual if chosen is None else chosen
