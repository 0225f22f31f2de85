"""Synthetic campaigns: their tests, the truth of each, and the comparison of results with it."""

import datetime
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from analysis.campaign.rows import SeriesRow
from analysis.catalogue import CATALOGUE, table_columns
from analysis.motion.two_mass import TwoMassParameters
from app.runs.analyze import Progress
from app.runs.batch.executors import ExecutorOptions, FailedItem, open_executor
from app.runs.batch.tasks import error_message, map_runs
from app.runs.blocks import RunBlock, StoredRun, count_flags
from app.runs.errors import RunError
from app.runs.metadata import SIMULATION_PROTOCOL, EndMetadata, Events, RunMetadata, create_metadata
from app.runs.writer import write_run
from app.simulated_stand.effects import check_effects, gauge_values, motion_values
from app.simulated_stand.gauge_chain import GaugeChain
from app.simulated_stand.motion import simulate_stand
from app.simulated_stand.options import check_within
from app.simulated_stand.signal import GaugeFaults, SimulatedGauge
from config.files import load_gauges, load_stand, published_row, published_table
from config.schema import Gauges, Stand
from drivers.clock import TimeBase
from drivers.samples import DeviceIdentity, SampleStatus
from messages.message import Message

CLOCK_UNCERTAINTY = 2e-5  # relative standard uncertainty to which each run times the device's clock
_BETWEEN_TESTS = datetime.timedelta(minutes=2)
_UNTIL_REST_S = 90.0
_SURELY_SLIPS = 1.05  # release over f_s g from which f_s of the paper is true; below it no slip


class CampaignOptions(msgspec.Struct, frozen=True, kw_only=True):
    """A synthetic campaign."""

    series: tuple[str, ...] = ()  # codes; empty is the 36 of Table 1
    repeats: int = 3
    seed: int = 1
    rate_hz: float = 1000.0
    duration_s: float = 10.0  # of each run after its release
    noise_m: float = 20e-6
    friction_scatter: float = 0.0  # standard deviation of f_d from run to run, as a share of it
    friction_per_kg: float = 0.0  # by which share f_d changes for each kg of added mass
    friction_by_contact: bool = False  # f_d of the contact's first row everywhere
    effects: dict[str, float] = {}
    """What is not ideal in every test, by the names in `effects.EFFECTS`."""
    static_friction: Literal["printed", "dynamic"] = "printed"
    """"printed": as in Table 1, or f_d where the row would then never slip; "dynamic": f_d everywhere."""

    def __post_init__(self) -> None:
        limits = {
            "repeats": (1, 1000), "rate_hz": (50.0, 100_000.0), "duration_s": (1.0, 600.0),
            "noise_m": (0.0, 1e-3), "friction_scatter": (0.0, 0.3), "friction_per_kg": (-0.04, 0.2),
        }  # fmt: skip
        for name, (low, high) in limits.items():
            check_within(name, getattr(self, name), low, high)
        check_effects(self.effects)


class SystematicErrors(msgspec.Struct, frozen=True):
    """Errors of the stand that the campaign does not know; drawn once from the stated uncertainties."""

    gains: tuple[float, float]  # by which share displacements are read too large
    bends_m: tuple[float, float]  # largest deviations from the calibration line
    lag_s: float
    clock: float  # by which share true time runs faster than the device's
    table_mass_kg: float  # error of the true value against the stated one, as of the next two
    plate_mass_kg: float
    gravity_m_per_s2: float


class SyntheticTest(msgspec.Struct, frozen=True):
    """One test: its file and its true parameters."""

    path: str
    series: str
    start_time: datetime.datetime
    seed: tuple[int, int]
    options: CampaignOptions
    errors: SystematicErrors
    parameters: TwoMassParameters
    truth: dict[str, float | int | str]


def draw_errors(stand: Stand, gauges: Gauges, seed: int) -> SystematicErrors:
    """Draw the errors of a stand from its stated uncertainties."""
    rng = np.random.default_rng((seed, 0))
    pair = (gauges.table, gauges.relative)
    gains = [(gauge.gain_relative_standard_uncertainty or 0.0) * rng.standard_normal() for gauge in pair]
    bends_m = [(gauge.nonlinearity_m or 0.0) * rng.uniform(-1.0, 1.0) for gauge in pair]
    delay_s = math.hypot(*(gauge.delay_standard_uncertainty_s for gauge in pair))
    lag, clock, table, plate, gravity = rng.standard_normal(5)
    return SystematicErrors(
        (gains[0], gains[1]),
        (bends_m[0], bends_m[1]),
        delay_s * lag,
        CLOCK_UNCERTAINTY * clock,
        stand.table_mass_standard_uncertainty_kg * table,
        stand.plate_mass_standard_uncertainty_kg * plate,
        stand.gravity_standard_uncertainty_m_per_s2 * gravity,
    )


def duration(options: CampaignOptions) -> datetime.timedelta:
    """How long the tests take together, one after another: they are dated before they are made."""
    return len(options.series or published_table()) * options.repeats * _BETWEEN_TESTS


def plan_tests(
    options: CampaignOptions, stand: Stand, gauges: Gauges, folder: Path, first: datetime.datetime
) -> list[SyntheticTest]:
    """The tests of a campaign, series after series in the order of Table 1. Raises ConfigError."""
    errors = draw_errors(stand, gauges, options.seed)
    drawn = dict(zip(("gain_error_table", "gain_error_relative"), errors.gains, strict=True))
    drawn |= {"lag_s": errors.lag_s, "clock_error": errors.clock, "campaign_seed": options.seed}
    drawn |= motion_values(options.effects) | gauge_values(options.effects)
    codes = [stand.series(code).code for code in options.series or published_table()]
    tests = []
    for number, (code, repeat) in enumerate(product(codes, range(1, options.repeats + 1))):
        start, seed = first + number * _BETWEEN_TESTS, (options.seed, 1 + number)
        parameters = _varied(series_parameters(options, stand, errors, code), options.friction_scatter, seed)
        path = folder / f"{start:%Y%m%dT%H%M%S}_{code}_{repeat:03d}.h5"
        truth = expected_results(options, parameters, code) | drawn
        tests.append(SyntheticTest(str(path), code, start, seed, options, errors, parameters, truth))
    return tests


def series_parameters(
    options: CampaignOptions, stand: Stand, errors: SystematicErrors, code: str
) -> TwoMassParameters:
    """What is true of a series: its mean, where runs differ. Raises ConfigError."""
    series, row = stand.series(code), published_row(code)
    added_kg = series.plate_mass_kg - stand.plate_mass_kg
    friction = row.friction_dynamic
    if options.friction_by_contact:
        rows = published_table().items()
        same = (one for other, one in rows if stand.series(other).contact == series.contact)
        friction = next(same).friction_dynamic
    friction *= 1.0 + options.friction_per_kg * added_kg
    gravity = stand.gravity_m_per_s2 + errors.gravity_m_per_s2
    release = (2.0 * math.pi / row.period_s) ** 2 * series.pullback_m
    printed = options.static_friction == "printed" and release > _SURELY_SLIPS * row.friction_static * gravity
    return TwoMassParameters.from_free_decay(
        period_s=row.period_s,
        damping_n1_per_s=row.damping_n1_per_s,
        table_mass_kg=stand.table_mass_kg + errors.table_mass_kg,
        plate_mass_kg=series.plate_mass_kg + errors.plate_mass_kg,
        friction_dynamic=friction,
        friction_static=row.friction_static if printed else None,
        pullback_m=series.pullback_m,
        gravity_m_per_s2=gravity,
    )


def expected_results(options: CampaignOptions, parameters: TwoMassParameters, code: str) -> dict[str, Any]:
    """What a perfect analysis would find, by the names of its results."""
    printed = published_row(code)
    motion = simulate_stand(parameters, motion_values(options.effects), _UNTIL_REST_S)
    given = {name: value for name, value in asdict(parameters).items() if value is not None}
    return given | {
        "friction_static": parameters.static_or_dynamic,
        "period_s": printed.period_s,
        "damping_n1_per_s": printed.damping_n1_per_s,
        "damping_n2_per_s": parameters.damping_coefficient_kg_per_s / (2.0 * parameters.table_mass_kg),
        **{row.name: getattr(motion, row.name) for row in CATALOGUE if hasattr(motion, row.name)},
    }


def _varied(parameters: TwoMassParameters, scatter: float, seed: tuple[int, int]) -> TwoMassParameters:
    own = parameters.friction_dynamic * (1.0 + scatter * np.random.default_rng(seed).standard_normal())
    static = None if parameters.friction_static is None else max(parameters.friction_static, own)
    return replace(parameters, friction_dynamic=own, friction_static=static)


class Comparison(msgspec.Struct, frozen=True):
    """One quantity of one series beside its truth."""

    series: str
    name: str
    value: float
    standard_uncertainty: float
    interval_95: tuple[float, float]
    truth: float

    @property
    def normalized_error(self) -> float:
        return (self.value - self.truth) / self.standard_uncertainty

    @property
    def is_covered(self) -> bool:
        return self.interval_95[0] <= self.truth <= self.interval_95[1]


def series_truths(
    options: CampaignOptions, stand: Stand, gauges: Gauges, codes: Sequence[str]
) -> dict[str, Any]:
    """What is true of each series, by its code: the mean of its runs where they differ."""
    errors = draw_errors(stand, gauges, options.seed)
    return {
        code: expected_results(options, series_parameters(options, stand, errors, code), code)
        for code in codes
    }


def compare(rows: Sequence[SeriesRow], truths: Mapping[str, Mapping[str, Any]]) -> Iterator[Comparison]:
    """Every quantity of the table that was found, beside its truth."""
    for row in rows:
        code = row.series.code
        for name in (column.name for column, _ in table_columns()):
            if name in row.quantities:
                found = row.quantities[name].quantity
                truth = float(truths[code][name])
                yield Comparison(
                    code, name, found.value, found.standard_uncertainty, found.interval_95, truth
                )


_HELD_S = 1.0
_PLACES_M = (2e-4, 2e-3)  # standard deviations of where table and plate stand at rest as read
_OVERLOADS = (SampleStatus.OVERLOAD_TABLE, SampleStatus.OVERLOAD_RELATIVE)


def write_test(test: SyntheticTest) -> StoredRun:
    """Record a synthetic test, faster than it would happen. Raises RunError."""
    block, release_s = sample_test(test, load_gauges())
    ending = EndMetadata(
        ended="simulated",
        end_time=test.start_time + datetime.timedelta(seconds=float(block.time_s[-1])),
        events=Events(pulled_back_s=0.0, release_s=release_s),
        losses=count_flags(block.status),
        time_base=timed_clock(test),
    )
    return write_run(Path(test.path), test_metadata(test), block, ending)


def sample_test(test: SyntheticTest, gauges: Gauges) -> tuple[RunBlock, float]:
    """What is recorded of a test, counts and readings by the stated calibration; and the time of release (s).

    The record's time is the device's; gauge 2 is late by `lag_s`, and both read by their true gains.
    """
    options, errors = test.options, test.errors
    rng = np.random.default_rng((*test.seed, 1))
    count = math.ceil((_HELD_S + options.duration_s) * options.rate_hz)
    time_s = np.arange(count) / options.rate_hz
    release_s = _HELD_S + rng.random() / options.rate_hz
    since_s = time_s * (1.0 + errors.clock) - release_s
    motion = simulate_stand(test.parameters, motion_values(options.effects), options.duration_s + 1.0)
    places_m = rng.normal(scale=_PLACES_M)
    values = gauge_values(options.effects)
    values["gauge_2_lag_s"] = values.get("gauge_2_lag_s", 0.0) + errors.lag_s
    is_absolute = gauges.relative.measures == "plate"
    chain = GaugeChain(values, test.parameters.pullback_m, options.rate_hz, is_absolute=is_absolute)
    shown = chain.read(motion.sample_displacements, since_s)
    stated = (gauges.table, gauges.relative)
    gauge_errors = zip(stated, errors.gains, errors.bends_m, places_m, shown, _OVERLOADS, strict=True)
    counts, readings, status = [], [], np.zeros(count, np.uint8)
    for gauge, gain, bend_m, place_m, shown_m, flag in gauge_errors:
        true = gauge.replace(gain_m_per_count=gauge.gain_m_per_count / (1.0 + gain))
        simulated = SimulatedGauge(true, GaugeFaults(options.noise_m, nonlinearity_m=bend_m), rng)
        read, overloaded = simulated.read(place_m + shown_m, np.zeros(count))
        counts.append(read)
        readings.append(gauge.displacement_m(read.astype(float)))
        status[overloaded] |= np.uint8(flag)
    block = RunBlock(time_s, np.column_stack(readings), status, np.column_stack(counts))
    return block, release_s / (1.0 + errors.clock)


def timed_clock(test: SyntheticTest) -> TimeBase:
    """The device's clock as it was timed in the run of a test."""
    error = CLOCK_UNCERTAINTY * np.random.default_rng((*test.seed, 2)).standard_normal()
    return TimeBase(1.0 + test.errors.clock + error, CLOCK_UNCERTAINTY)


class RecordedTest(msgspec.Struct, frozen=True):
    """Result of a test: its run, or why there is none."""

    path: str
    error: Message = Message("")


def record_test(test: SyntheticTest, _progress: object = None) -> RecordedTest:
    """`write_test` for an executor: never raises, errors are in the result."""
    try:
        return RecordedTest(write_test(test).path)
    except Exception as error:
        return RecordedTest(test.path, error_message(error))


def record_tests(tests: Sequence[SyntheticTest], options: ExecutorOptions, progress: Progress) -> None:
    """Record tests into their folder, which is made. Raises RunError for the first that fails."""
    Path(tests[0].path).parent.mkdir(parents=True, exist_ok=True)
    with open_executor(options, len(tests)) as executor:
        for result in map_runs(tests, record_test, executor, progress):
            if error := result.message if isinstance(result, FailedItem) else result.error:
                raise RunError(error)


def test_metadata(test: SyntheticTest) -> RunMetadata:
    """Metadata of the run: the stated stand, and the truth beside it."""
    return create_metadata(
        load_stand(),
        load_gauges(),
        test.start_time,
        series=test.series,
        title=f"Synthetic pullback test {test.series}",
        operator="demo",
        note="simulated, not recorded from a stand",
        device=DeviceIdentity(
            SIMULATION_PROTOCOL, "synthetic campaign", serial_number=f"seed {test.options.seed}"
        ),
        rate_hz=test.options.rate_hz,
        source="simulated",
        truth=test.truth,
    )
