"""Effects of the stand over simulated runs: in all of them, in one of them, in none."""

from pathlib import Path

import pytest

from tools import page_commands


def test_table_tells_what_is_the_stands_and_what_is_of_one_run(slipstand, real_stand_runs, monkeypatch):
    monkeypatch.setenv("COLUMNS", page_commands.COLUMNS)
    said = slipstand("table", real_stand_runs)
    _, _, below = said.out.partition("\nEffects of the stand\n")
    notes, _, others = below.partition("\n\n")
    mode, ramp = (" ".join(note.split()) for note in notes.removeprefix("- ").split("\n- "))

    assert mode.startswith(("3 of 3 runs: a second mode at 7.99", "3 of 3 runs: a second mode at 8.00"))
    assert mode.endswith("% of the table's mass: tighten what is mounted.")
    assert ramp.startswith("1 of 3 runs (20261121T100000_1FFM0_001.h5): the release took 20.")
    assert "second mode" not in others
    shown = page_commands.shown_lines("slipstand table real-stand")
    assert page_commands.faults(shown, said.out.splitlines()) == [], said.out


def test_table_gives_sizes_and_runs_to_programs(slipstand, real_stand_runs):
    mode, ramp = slipstand("table", real_stand_runs, "--json").json["effects_of_stand"]
    share = mode["sizes"]["second_mode_mass_share"]

    assert (mode["name"], mode["scope"], mode["run_count"], mode["deviating"]) == (
        "second-mode",
        "stand",
        3,
        [],
    )
    assert share["value"] == pytest.approx(0.03, rel=0.05)
    assert share["unit"] == "1"
    assert share["runs"] == 3
    assert mode["sizes"]["second_mode_frequency_hz"]["value"] == pytest.approx(8.0, rel=0.01)
    assert mode["pullback_m"] is None
    assert (ramp["name"], ramp["scope"]) == ("release-ramp", "runs")
    assert [Path(run).name for run in ramp["runs"]] == ["20261121T100000_1FFM0_001.h5"]
    assert mode["message"].startswith("3 of 3 runs: a second mode")


def test_table_of_a_clean_stand_says_nothing_of_effects(slipstand, short_runs):
    document = slipstand("table", *short_runs, "--json").json

    assert document["effects_of_stand"] == []
    assert "Effects of the stand" not in slipstand("table", *short_runs).out
