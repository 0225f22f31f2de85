"""Masses given beside those of stand and series are said."""

import pytest

from app.cli.option_values import print_mass_overrides
from app.cli.shared_options import MassOptions
from config.schema import ConfigError


@pytest.mark.parametrize(
    ("series", "table_kg", "plate_kg", "said"),
    [
        (None, None, None, []),
        ("1FFM1", 131.6, 27.4, []),
        ("1ffm1", None, 40.0, ["note: the plate mass is 40 kg as given, not the 27.4 kg of series 1FFM1"]),
        (None, None, 40.0, ["note: the plate mass is 40 kg as given, not the 22.4 kg of the stand"]),
        (None, 120.0, None, ["note: the table mass is 120 kg as given, not the 131.6 kg of the stand"]),
    ],
)
def test_only_other_masses_are_said(
    capsys: pytest.CaptureFixture[str],
    series: str | None,
    table_kg: float | None,
    plate_kg: float | None,
    said: list[str],
) -> None:
    print_mass_overrides(MassOptions(series=series, plate_mass=plate_kg, table_mass=table_kg))
    captured = capsys.readouterr()
    assert (captured.out, captured.err.splitlines()) == ("", said)


def test_a_series_that_is_not_one_is_refused() -> None:
    with pytest.raises(ConfigError, match="'9XX'"):
        print_mass_overrides(MassOptions(series="9XX", plate_mass=40.0))
