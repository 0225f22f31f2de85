"""Numbers of messages: few digits, a unit, never an exponent."""

import math
import re
from collections.abc import Sequence

import numpy as np
import pytest

from analysis.formatting import (
    NO_BREAK_SPACE,
    format_interval,
    format_length,
    format_number,
    format_uncertainty,
    format_value,
    format_with_unit,
    unbreakable,
)
from analysis.identify import identify
from analysis.motion.one_mass import OneMassDecay, simulate
from analysis.one_mass.identify import MeasuredQuantity, identify_one_mass, single_channel
from analysis.quantities import ResultWarning
from analysis.record import Record, RecordError, StandMasses
from analysis.synthetic import Truth, simulate_readings

EXPONENT = r"\de[+-]\d"


@pytest.mark.parametrize("uncertainty", [2.2e-4, 9.96e-4, 0.0123, 1.5, 120.0])
def test_an_interval_has_no_fewer_digits_than_its_value(uncertainty: float) -> None:
    value = 0.10019 if uncertainty < 1.0 else 59370.0
    low, _, high = format_interval(value - 1.96 * uncertainty, value + 1.96 * uncertainty).partition(" to ")
    decimals = len(format_value(value, uncertainty).value.partition(".")[2])
    assert {len(end.partition(".")[2]) for end in (low, high)} <= {decimals, decimals + 1}


@pytest.mark.parametrize(
    ("uncertainty", "shown"),
    [(2e-7, "2.0e-7"), (9.96e-6, "1.0e-5"), (1e-5, "0.000010"), (0.00022, "0.00022"), (0.0, "0")],
)
def test_an_uncertainty_has_two_digits_at_any_size(uncertainty: float, shown: str) -> None:
    assert format_uncertainty(uncertainty) == shown


@pytest.mark.parametrize(
    ("value_m", "shown"),
    [
        (0.0, "0 µm"),
        (-0.0, "0 µm"),
        (1.23456e-9, "0.00123 µm"),
        (-20e-6, "-20 µm"),
        (0.9994e-3, "999 µm"),
        (0.9996e-3, "1.00 mm"),
        (1.83e-3, "1.83 mm"),
        (0.4567891, "456.79 mm"),
        (0.55, "0.55 m"),
        (12.0, "12 m"),
        (-1234567.0, "-1230000 m"),
        (math.nan, "nan m"),
    ],
)
def test_a_length_is_shown_in_the_unit_that_suits_it(value_m: float, shown: str) -> None:
    assert format_length(value_m) == format_with_unit(value_m, "m") == shown


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [
        (11000.0, 3, "11000"),
        (1.2e-7, 3, "0.00000012"),
        (8388607.0, 7, "8388607"),
        (1.7e9 + 0.25, 12, "1700000000.25"),
    ],
)
def test_a_number_is_shown_without_exponent(value: float, digits: int, shown: str) -> None:
    assert format_number(value, digits) == shown
    assert format_with_unit(value, "rad").endswith(" rad")


ONE_MASS_KINDS = ("touched", "coarse", "plain")


def one_mass_cautions(
    scale: float,
    unit: str,
    quantity: MeasuredQuantity = "displacement",
    kinds: Sequence[str] = ONE_MASS_KINDS,
) -> dict[str, str]:
    """What is said of a decay with friction: with a second mode and a touch, in coarse steps, or plain."""
    time_s = np.arange(0.0, 30.0, 0.002)
    value = simulate(OneMassDecay(0.5, 0.3, 0.02, 0.0, 1.0), time_s).displacement_m
    mode = 0.05 * np.exp(-0.1 * time_s) * np.cos(2.0 * np.pi * 5.3 * time_s)
    touched = np.where(time_s > 15.0, 0.3, 0.0)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(time_s))
    readings = dict(
        zip(ONE_MASS_KINDS, (value + mode + touched + noise, np.round(value, 1), value + noise), strict=True)
    )
    said: list[ResultWarning] = []
    for kind in kinds:
        decay = single_channel(time_s, scale * readings[kind])
        found = identify_one_mass(decay, quantity=quantity, unit=unit)
        said += found.warnings
    return {caution.code: str(caution.message) for caution in said}


def test_warnings_of_one_mass_give_units() -> None:
    said = one_mass_cautions(1e-3, "m")

    assert {
        "second-mode",
        "coarse-steps",
        "moves-again",
        "coulomb-biases-log-decrement",
        "model-inadequate",
    } <= (said.keys())
    assert "is 298 µm off and moves by " in said["moves-again"]
    assert "in steps of 100 µm:" in said["coarse-steps"]
    assert "µm)" in said["coulomb-biases-log-decrement"]
    assert "µm of residual (" in said["model-inadequate"]
    assert "µm of noise" in said["model-inadequate"]
    assert "µm, beside" in said["second-mode"]


def test_warnings_of_one_mass_give_the_unit_that_was_told() -> None:
    def moves_again(scale: float, unit: str, quantity: MeasuredQuantity = "displacement") -> str:
        return one_mass_cautions(scale, unit, quantity, kinds=["touched"])["moves-again"]

    assert "is 0.000298 rad off" in moves_again(1e-3, "rad")
    assert "is 0.0000298 V off" in moves_again(1e-4, "V")
    assert "is 296 m/s² off" in moves_again(1e3, "m", "acceleration")


def test_no_message_of_a_record_has_an_exponent() -> None:
    masses = StandMasses(22.4, 131.6)
    time_s, table_m, relative_m = simulate_readings(Truth())
    hum_m = 1.83e-3 * np.sin(2.0 * np.pi * 50.0 * time_s)
    drifting = Record(time_s, table_m - 1e-4 * time_s + hum_m, relative_m, masses, pullback_m=1e-3)
    said = {caution.code: str(caution.message) for caution in identify(drifting).warnings}

    assert "hums at 50 Hz by 2.01 mm: f_d" in said["mains-hum"]
    assert "drifts by -101 µm/s, 1.11 mm in this record:" in said["gauge-1-drifts"]
    assert " mm, the series by 1.00 mm:" in said["pullback-unlike-series"]
    assert not [message for message in said.values() if re.search(EXPONENT, message)]


def test_times_that_go_back_are_told_apart_however_late_they_are() -> None:
    time_s = 1.7e9 + 1e-3 * np.arange(100)
    time_s[50] -= 0.002

    with pytest.raises(RecordError, match=r"row 50: 1700000000\.049\d* s, then 1700000000\.048\d* s"):
        identify(Record(time_s, np.zeros(100), None, StandMasses(131.6, 22.4)))


@pytest.mark.parametrize(
    ("text", "unbroken"),
    [
        ("by 0.9975 ± 0.0029 s/m: clean it", "by 0.9975~±~0.0029~s/m: clean it"),
        ("from −25.052 % to −24.9 %", "from −25.052~% to −24.9~%"),
        ("p = 0.59 at 6 mm, in 3 series", "p~=~0.59 at 6~mm, in 3 series"),
        ("на 6 мм за 5 мс", "на 6~мм за 5~мс"),
        ("run 1 of 3 more", "run 1 of 3 more"),
    ],
)
def test_no_line_of_a_sentence_ends_inside_a_value(text: str, unbroken: str) -> None:
    assert unbreakable(text) == unbroken.replace("~", NO_BREAK_SPACE)
