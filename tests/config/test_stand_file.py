"""The stand file as the window writes it: comments stay, what cannot be is refused as when it is read."""

from pathlib import Path

import pytest

from config.files import load_stand, parse_stand, save_stand
from config.schema import ConfigError, Contact, Stand

OURS = """# ours
name = "Stand 2"  # by the window
table_mass_kg = 100.0  # weighed on 2 March
plate_mass_kg = 20.0

[pullbacks_m]
1 = 0.012  # to the stop
2 = 0.009

[contacts]
FF = { name = "fluoroplastic" }  # new
[added_masses_kg]
M0 = 0.0
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "settings"))
    return tmp_path / "settings"


def test_without_a_file_of_its_own_a_lab_takes_over_the_shipped_one_with_its_comments(folder: Path) -> None:
    stand = load_stand().replace(plate_mass_kg=22.5)
    assert save_stand(stand) == folder / "stand.toml"
    assert load_stand() == stand
    written = (folder / "stand.toml").read_text(encoding="utf-8")
    assert "# Upper steel plate without added mass.\nplate_mass_kg = 22.5\n" in written


def test_comments_stay_with_what_they_are_about(folder: Path) -> None:
    folder.mkdir()
    (folder / "stand.toml").write_text(OURS, encoding="utf-8")
    stand = load_stand().replace(
        table_mass_kg=101.5,
        pullbacks_m={"1": 0.011, "3": 0.006},
        contacts={"FF": Contact("PTFE"), "SS": Contact("steel")},
    )
    save_stand(stand)
    assert load_stand() == stand
    written = (folder / "stand.toml").read_text(encoding="utf-8")
    for expected in (
        "# ours\n",
        "table_mass_kg = 101.5  # weighed on 2 March\n",
        "1 = 0.011  # to the stop\n",
        'FF = { name = "PTFE" }  # new\n',
    ):
        assert expected in written
    assert "0.009" not in written
    assert "gravity" not in written, "a default needs no line"


def test_a_stand_that_was_written_and_undone_is_the_same_file(folder: Path) -> None:
    folder.mkdir()
    (folder / "stand.toml").write_text(OURS, encoding="utf-8")
    stand = load_stand()
    save_stand(stand.replace(plate_mass_kg=21.0))
    save_stand(stand)
    assert (folder / "stand.toml").read_text(encoding="utf-8") == OURS


def test_a_file_that_cannot_be_read_is_not_written_over(folder: Path) -> None:
    stand = load_stand()
    folder.mkdir()
    (folder / "stand.toml").write_text("name = 3\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"stand\.toml: name = 3"):
        save_stand(stand)
    assert (folder / "stand.toml").read_text(encoding="utf-8") == "name = 3\n"


@pytest.mark.parametrize("codes", [{"12": 0.1}, {"a": 0.1}, {}])
def test_codes_that_make_no_series_are_refused_in_the_file_too(folder: Path, codes: dict[str, float]) -> None:
    folder.mkdir()
    lines = "".join(f"{code} = {value}\n" for code, value in codes.items())
    text = OURS.replace("1 = 0.012  # to the stop\n2 = 0.009\n", lines)
    (folder / "stand.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"stand\.toml: pullbacks_m"):
        load_stand()


def test_a_stand_of_values_is_checked_as_its_file_is() -> None:
    values = {"name": "x", "table_mass_kg": 1.0, "plate_mass_kg": -1.0}
    values |= {"pullbacks_m": {"1": 0.01}, "contacts": {"S": {"name": "s"}}, "added_masses_kg": {"M0": 0.0}}
    with pytest.raises(ConfigError, match=r"plate_mass_kg = -1\.0 must be a finite number above 0"):
        parse_stand(values)
    stand = parse_stand({**values, "plate_mass_kg": 2.0})
    assert isinstance(stand, Stand)
    assert stand.all_series == ("1SM0",)
