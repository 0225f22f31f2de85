"""Numbers as people read them."""

import math

import pytest

from analysis.catalogue import MILLIMETRE
from analysis.quantities import Quantity
from app.presenters import number_text


@pytest.mark.parametrize(
    ("value", "uncertainty", "shown"),
    [
        (0.1003, 0.00064, "0.10030 ± 0.00064"),
        (319.942, 0.0478, "319.942 ± 0.048"),
        (0.5, 0.0996, "0.50 ± 0.10"),
        (0.5, 0.0994, "0.500 ± 0.099"),
        (123456.0, 1234.0, "123500 ± 1200"),
        (9.94, 9.96, "10 ± 10"),
        (-0.0102649, 0.000012, "−0.010265 ± 0.000012"),
        (1.5, 1.0, "1.5 ± 1.0"),
        (-0.0001, 0.05, "0.000 ± 0.050"),
    ],
)
def test_value_and_uncertainty_end_at_the_same_digit(value: float, uncertainty: float, shown: str) -> None:
    assert " ± ".join(number_text.format_uncertain(Quantity.normal(value, uncertainty, "1"))) == shown


@pytest.mark.parametrize("uncertainty", [0.0, math.nan, math.inf])
def test_no_uncertainty_is_claimed_where_there_is_none(uncertainty: float) -> None:
    assert number_text.format_uncertain(Quantity.normal(-0.25, uncertainty, "1")) == ("−0.25", "")


def test_a_missing_length_is_a_dash() -> None:
    assert number_text.format_in(MILLIMETRE, math.nan).startswith("–")
    assert number_text.format_in(MILLIMETRE, -0.01004, 2) == "−10.04\u202fmm"


@pytest.mark.parametrize(
    ("size", "shown"),
    [(210_400_000_000, "210\u202fGB"), (420_000_000, "0.4\u202fGB"), (12_300_000, "12\u202fMB")],
)
def test_disk_sizes(size: int, shown: str) -> None:
    assert number_text.format_file_size(size) == shown


def test_a_typed_number_is_read_as_people_write_it() -> None:
    assert number_text.parse_number(" \u22122,5 ") == -2.5
    assert number_text.parse_number("  ") is None
    assert all(math.isnan(number_text.parse_number(text) or 0.0) for text in ("two", "inf", "1,2,3"))
