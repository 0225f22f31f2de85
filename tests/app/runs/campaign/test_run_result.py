"""What a campaign takes of an analysis: effects of the stand, where they were looked for."""

import datetime
from pathlib import Path
from typing import Any

import pytest

from app.runs.campaign.run_result import run_result
from app.runs.metadata import create_metadata
from config.files import load_gauges, load_stand
from tests.app.runs.runs_kit import ANALYSIS

DAY = datetime.datetime(2026, 11, 21, tzinfo=datetime.UTC)
OF_ALL = [{"name": "coulomb"}, {"name": "coulomb+tilt"}]


@pytest.mark.parametrize(
    ("model", "effects"),
    [
        ({"parts": ["second-mode"], "tried": OF_ALL}, ("second-mode",)),
        ({"parts": [], "tried": OF_ALL}, ()),
        ({"parts": [], "tried": OF_ALL[:1]}, None),  # of a law that was asked for
        ({"tried": OF_ALL}, None),  # of a version that knew no effects
    ],
)
def test_effects_are_known_where_they_were_looked_for(
    model: dict[str, Any], effects: tuple[str, ...] | None
) -> None:
    document = ANALYSIS | {"model": ANALYSIS["model"] | model}
    found = run_result(Path("run.h5"), create_metadata(load_stand(), load_gauges(), DAY), document)

    assert found.effects == effects
    assert found.noise_m == 2e-5


def test_a_record_without_a_law_says_nothing_of_effects() -> None:
    document = ANALYSIS | {"model": None}
    found = run_result(Path("run.h5"), create_metadata(load_stand(), load_gauges(), DAY), document)

    assert (found.effects, found.noise_m) == (None, None)
