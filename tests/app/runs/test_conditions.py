"""Conditions of a test: limits, and their text form."""

import math

import msgspec
import pytest

from app.runs.errors import MetadataError
from app.runs.metadata import Conditions


@pytest.mark.parametrize(
    ("fact", "words"),
    [
        ({"temperature_c": math.nan}, "temperature_c = nan cannot be"),
        ({"temperature_c": 293.0}, "temperature_c = 293 cannot be. Give -40 to 80"),
        ({"humidity_percent": math.inf}, "humidity_percent = inf"),
        ({"humidity_percent": -1.0}, "humidity_percent = -1"),
        ({"run_in_number": -1}, "run_in_number = -1"),
        ({"plate_id": "a\nb"}, "plate_id = 'a"),
        ({"surface_preparation": "x" * 201}, "up to 200 characters"),
        ({"other": {"weather": "\x1b[2J"}}, "weather"),
        ({"other": {"two words": "x"}}, "'two words' is not a usable name"),
        ({"other": {"plate_id": "x"}}, "'plate_id' is not a usable name"),
    ],
)
def test_what_cannot_be_is_refused_by_name(fact, words):
    with pytest.raises(MetadataError) as refused:
        Conditions(**fact)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_text_is_sorted_into_types():
    given = {"temperature_c": "21.5", "run_in_number": "3", "plate_id": "P-1", "weather": "dry"}
    assert Conditions.parse(given) == Conditions(
        21.5, plate_id="P-1", run_in_number=3, other={"weather": "dry"}
    )
    with pytest.raises(MetadataError, match="is not a number"):
        Conditions.parse({"humidity_percent": "wet"})


def test_an_engine_that_is_told_nonsense_refuses_it():
    with pytest.raises(msgspec.ValidationError, match="humidity_percent"):
        msgspec.convert({"humidity_percent": 140.0}, Conditions)


@pytest.mark.parametrize("series", ["../../x", "..\\x", "1FFM0\0", "1FFM0\n", "*"])
def test_a_series_that_would_lead_out_of_the_folder_of_runs_is_refused(metadata, series):
    with pytest.raises(MetadataError, match="cannot be part of a file's name"):
        metadata.replace(series=series)
