"""Masses given on the command line beside those that the stand and the series have."""

from app.cli import output as out


def tell_masses(series: str | None, table_mass_kg: float | None, plate_mass_kg: float | None) -> None:
    """Say on stderr which masses stand for others. Raises ConfigError for a series that is not one."""
    from config.files import load_stand

    stand = load_stand()
    of_series = stand.series(series) if series else None
    plate = of_series.plate_mass_kg if of_series else stand.plate_mass_kg
    whose = f"series {of_series.code}" if of_series else "the stand"
    for name, given, usual, source in (
        ("table", table_mass_kg, stand.table_mass_kg, "the stand"),
        ("plate", plate_mass_kg, plate, whose),
    ):
        if given is not None and given != usual:
            out.tell(f"note: the {name} mass is {given:g} kg as given, not the {usual:g} kg of {source}")
