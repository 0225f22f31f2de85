"""Shared by the tests of the pullback: simulated motions, also with mistakes of the operator."""

import numpy as np

from app.acquisition.messages import PullbackState
from app.acquisition.pullback.plan import PullbackPlan, Transition
from app.acquisition.pullback.state_machine import PullbackStateMachine
from app.simulated_stand.motion import RepeatedPullback, released_motion, stand_truth
from app.simulated_stand.options import SimulatedStandOptions, Timetable
from config.files import load_stand

TIMETABLE = Timetable(rest_s=0.6, pull_s=0.8, hold_s=0.6, decay_s=3.0, recentre_s=0.5)
TO_RELEASE = [PullbackState.PULLING, PullbackState.HELD, PullbackState.ARMED, PullbackState.RELEASED]
"""What a pullback goes through after the zero, when all is as it should be."""


def recording(
    rate_hz, duration_s, *, series="1FFM0", side=1, noise_m=20e-6, timetable=TIMETABLE, seed=0, **options
):
    """Displacements (n,) of both gauges of a simulated stand, with noise."""
    stand = load_stand()
    pullback_m = options.pop("pullback_m", stand.series(series).pullback_m)
    chosen = SimulatedStandOptions(series=series, pullback_m=side * pullback_m, **options)
    true = stand_truth(chosen, stand)
    motion = RepeatedPullback(true.pullback_m, released_motion(true, timetable), timetable)
    table, relative = motion.displacements(np.arange(round(duration_s * rate_hz)) / rate_hz)
    return with_noise(table, noise_m, seed), with_noise(relative, noise_m, seed + 1)


def with_noise(values, noise_m, seed):
    """Values with white noise."""
    return values + noise_m * np.random.default_rng(seed).standard_normal(len(values))


def follow(plan: PullbackPlan, table, relative, block=None, first_index=0):
    """Feed a test block by block; return it, its turns, and at which index each was known."""
    test = PullbackStateMachine(plan, first_index)
    block = block or max(1, round(plan.rate_hz / 250))
    turns: list[Transition] = []
    known: list[int] = []
    for start in range(0, len(table), block):
        end = min(start + block, len(table))
        new = test.add_samples(first_index + start, table[start:end], relative[start:end])
        turns += new
        known += [first_index + end] * len(new)
        if test.state is PullbackState.CLOSING:
            break
    return test, turns, known


def states(turns):
    """The states in their order, each once in a row."""
    found = [turn.state for turn in turns]
    return [state for i, state in enumerate(found) if i == 0 or state is not found[i - 1]]


def notes(turns):
    """What was said."""
    return [turn.note for turn in turns if turn.note]


def hand(*corners, rate_hz=500.0, noise_m=20e-6):
    """A table moved by hand through corners (time s, displacement m), and a plate that follows it."""
    time_s = np.arange(round(corners[-1][0] * rate_hz)) / rate_hz
    table = np.interp(time_s, *zip(*corners, strict=True))
    return with_noise(table, noise_m, 1), with_noise(np.zeros_like(table), noise_m, 2)
