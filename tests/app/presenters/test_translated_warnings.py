"""What the analysis says of real records is translated into Russian, its values untouched."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from analysis.gauge_health import GaugeSamples, diagnose, measure_health
from analysis.identify import identify
from analysis.one_mass.identify import identify_one_mass, single_channel
from analysis.record import Record, StandMasses
from analysis.synthetic import Truth, simulate_readings
from app.presenters.gauge_health import gauge_health_state
from app.presenters.results import in_words
from messages.i18n import translate
from messages.message import Message, message
from tools.translations import ROOT

REFERENCE = ROOT / "docs" / "reference" / "warnings.md"
SOURCES = {
    path: path.read_text(encoding="utf-8")
    for folder in ("analysis", "app/runs")
    for path in sorted((ROOT / folder).rglob("*.py"))
}
WARNING = re.compile(r"\b(ResultWarning|result_warning|Symptom|Part)\(")
SPEAKING = {path: text for path, text in SOURCES.items() if WARNING.search(text)}
"""Modules that warn."""
KEPT = re.compile(
    r"\bf_[sd]\b|\bu_s\b|\bx_k\b|\bBIC\b|\bT\b|\bn1\b|[a-z]+\+tilt|coulomb|static|\b[mk]?m\b|µm|rms|mrad"
)
NOISE_M = 2e-5


@pytest.fixture(autouse=True)
def russian(use_language: Callable[[str], None]) -> None:
    use_language("ru")


def test_the_modules_that_warn_know_every_code_of_the_reference() -> None:
    cells = [line.split("|")[1] for line in REFERENCE.read_text().splitlines() if line.startswith("| `")]
    codes = {code for cell in cells for code in re.findall(r"`([a-z0-9-]+)`", cell)}
    assert len(codes) > 30
    spoken = "\n".join(SPEAKING.values())
    assert {
        code
        for code in codes
        if f'"{code}"' not in spoken
        and not re.search(re.sub("gauge-[12]-(drifts|range)", r'"gauge-\\{\\w+\\}-\1"', code), spoken)
    } == set()


def records() -> Iterator[tuple[str, Record, str]]:
    """Codes that a record is known to bring, the record, and the law asked for."""
    masses = StandMasses(131.6, 22.4)
    time, table, relative = simulate_readings(Truth())
    noise = NOISE_M * np.random.default_rng(1).standard_normal(len(time))
    hum = 4e-4 * np.sin(2.0 * np.pi * 50.0 * time)
    stuck = (time > 2.31) & (time < 2.4)
    late, early = time >= 1.1, time < 2.5
    spiked = table.copy()
    spiked[[3000, 4000, 5000]] += 3e-3

    def made(
        codes: str, *columns: np.ndarray | None, model: str = "auto", **known: object
    ) -> tuple[str, Record, str]:
        return codes, Record(time, *columns, masses, **known), model  # type: ignore[arg-type]

    yield made("gauge-2-absent", table, None)
    yield made("gauge-2-dead", table, noise)
    yield made("gauge-2-reversed", table, -relative)
    yield made("gauge-2-absolute", table, relative + table)
    yield made("gauge-2-relative", table, relative, gauge_2_measures_plate=True)
    yield made("pullback-negative", -table, -relative)
    yield made("pullback-unlike-series", table, relative, pullback_m=0.003)
    yield made("gauge-1-drifts", table - 1e-4 * time, relative)
    yield made("gauge-2-drifts", table, relative - 2e-5 * time)
    yield made("mains-hum", table + hum, relative)
    yield made("frozen", np.where(stuck, table[np.argmax(stuck)], table), relative)
    yield made("spikes", spiked, relative)
    yield (
        "release-not-recorded",
        Record(time[late], table[late], relative[late], masses, pullback_m=0.012),
        "auto",
    )
    yield "tail-too-short slip-not-ended", Record(time[early], table[early], relative[early], masses), "auto"
    yield "static-not-needed", Record(*simulate_readings(Truth(friction_dynamic=0.25)), masses), "static"
    yield (
        "masses-contradict-motion model-inadequate",
        Record(time, table, relative, StandMasses(22.4, 131.6)),
        "auto",
    )
    one_way = Truth(period_s=0.43, friction_dynamic=0.13, friction_static=0.247, tilt_rad=1e-3)
    yield "tilt-not-identified static-not-identified", Record(*simulate_readings(one_way), masses), "auto"
    yield "no-slip", Record(*simulate_readings(Truth(friction_dynamic=0.6)), masses), "auto"


@pytest.mark.parametrize(
    ("codes", "record", "model"), tuple(records()), ids=lambda value: value if isinstance(value, str) else ""
)
def test_what_is_said_of_a_record_is_translated(codes: str, record: Record, model: str) -> None:
    said = {caution.code: caution.message for caution in identify(record, model=model).warnings}
    assert set(codes.split()) <= said.keys()
    for text in said.values():
        assert_translated(text)


def test_what_is_said_of_one_mass_is_translated() -> None:
    time_s = np.arange(0.0, 10.0, 0.005)
    decay = np.exp(-0.2 * time_s) * np.cos(2.0 * np.pi * 2.0 * time_s)
    mode = 0.1 * np.exp(-0.1 * time_s) * np.cos(2.0 * np.pi * 5.3 * time_s)
    noise = 0.002 * np.random.default_rng(3).standard_normal(len(time_s))
    said = [
        caution.message
        for value in (decay + mode + noise, np.round(decay, 1))
        for caution in identify_one_mass(single_channel(time_s, value)).warnings
    ]
    assert said
    for text in said:
        assert_translated(text)


def test_what_is_said_of_a_gauge_is_translated() -> None:
    rng = np.random.default_rng(1)
    x = 1e-3 + 1e-5 * rng.standard_normal(5000)
    time = np.arange(5000) / 1000.0
    few = np.where(rng.random(5000) < 0.1, np.nan, x)
    seen = set()
    for value in (
        np.full(5000, 2e-3), few, np.minimum(x, 1e-3), x + 15e-3, 1e-3 + 20.0 * (x - 1e-3), x + 1e-4 * time,
        x + 2e-4 * np.sin(2.0 * np.pi * 50.0 * time), x + 5e-3 * np.sin(2.0 * np.pi * 3.0 * time),
        np.repeat(x[::2], 2),
    ):  # fmt: skip
        health = measure_health(
            GaugeSamples(value, rate_hz=1000.0, overloaded=np.isnan(value), range_m=0.0165)
        )
        for symptom in diagnose(health):
            seen.add(symptom.code)
            assert_translated(symptom.message)
            assert_translated(symptom.remedy)
    dead = measure_health(GaugeSamples(np.full(5000, 2e-3), np.zeros(5000, bool), 1000.0))
    (shown,) = gauge_health_state("1", dead).symptoms
    assert shown.message == "все показания равны 2.0000 mm: канал мёртв или завис"
    assert shown.remedy.startswith("Троньте стол")
    assert {"dead", "absent", "clipped", "off-centre", "noisy", "drifts", "hums", "moves", "repeats"} <= seen


@pytest.mark.parametrize("value", ["-0", "1e+99", "7 of 9", "{0}", "\\1", "a: b; c, d", "%s", ""])
def test_unusual_values_come_through(value: str) -> None:
    busy = message("port {port} is busy: close the program that has it open", port=value)
    assert translate(busy) == f"порт {value} занят: закройте программу, которая его открыла"


def test_english_is_said_to_the_letter(use_language: Callable[[str], None]) -> None:
    use_language("en")
    sentence = message("{path}: the disk is too slow. Use a faster disk", path=Path("ru.po"))
    assert translate(sentence) == "ru.po: the disk is too slow. Use a faster disk"


def assert_translated(text: Message) -> None:
    """Nothing but symbols, names and units stays English, and every number of the message is still there."""
    said = in_words(text)
    assert re.findall(r"[A-Za-z]{3,}", KEPT.sub("", said)) == [], said
    for number in re.findall(r"\d+(?:\.\d+)?", str(text)):
        assert number in said, str(text)
