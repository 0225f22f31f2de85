"""Compiled sampling of a walked motion with Stribeck friction, its largest rates, and its differences.

Callable from other compiled code and without the interpreter lock::

    motion = sample_stribeck(parameters, phases, nodes, times, channels)
    motion, gradient = sample_stribeck_with_gradient(parameters, times, directions)

parameters, phases, nodes : as in `analysis.motion.stribeck_integration`
times : (n,) float64, sorted
motion : (channels, n), or (2, n) of the latter, as `analysis.motion.sampling.sample` gives it
directions : (q, 11) float64, in the space of parameters
gradient : (q, 2, n), derivatives by central differences, good to about 1e-4 of their largest

A slip is sampled by the quintic that has the displacements, rates and accelerations of two nodes.
"""

import math

import numpy as np

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_part
from analysis.motion.events import (
    DAMPING,
    GRAVITY,
    PLATE_MASS,
    PULLBACK,
    RELATIVE,
    RELEASE,
    SIGN,
    START,
    STIFFNESS,
    TABLE,
    TABLE_MASS,
    VELOCITY,
    peak_rates_in_stick,
)
from analysis.motion.sampling import (
    BLOCK,
    block_basis,
    block_displacements,
    block_rates,
    phase_blocks,
    rotation_tables,
)
from analysis.motion.stribeck_integration import (
    FIRST_NODE,
    NODE_ACCELERATION,
    NODE_RELATIVE,
    NODE_SLIP,
    NODE_SLIP_RATE,
    NODE_TABLE,
    NODE_TAU,
    NODE_VELOCITY,
    STRIBECK,
    integrate_stribeck,
    slope_in_slip,
)


@compiled_part
def _quintic(x: float, h: float, ends: tuple[float, float, float, float, float, float]) -> float:
    """Value at x in [0, 1] from value, slope and curvature at 0 and at 1, which are `h` apart."""
    v0, s0, c0, v1, s1, c1 = ends
    y = 1.0 - x
    start = v0 * (1.0 + 3.0 * x + 6.0 * x * x) + h * x * (s0 * (1.0 + 3.0 * x) + 0.5 * h * x * c0)
    end = v1 * (1.0 + 3.0 * y + 6.0 * y * y) - h * y * (s1 * (1.0 + 3.0 * y) - 0.5 * h * y * c1)
    return y * y * y * start + x * x * x * end


@compiled_part
def _cubic(x: float, h: float, v0: float, s0: float, v1: float, s1: float) -> float:
    """Value at x in [0, 1] from value and slope at 0 and at 1, which are `h` apart."""
    y = 1.0 - x
    return y * y * (v0 * (1.0 + 2.0 * x) + h * x * s0) + x * x * (v1 * (1.0 + 2.0 * y) - h * y * s1)


@compiled_part
def _between(nodes: Floats, k: int, tau: float, state: Floats) -> None:
    """Write (u1, u1', u2' - u1', u2 - u1) at `tau` between the nodes k and k + 1."""
    a, b = nodes[k], nodes[k + 1]
    h = b[NODE_TAU] - a[NODE_TAU]
    x = (tau - a[NODE_TAU]) / h
    velocity, slip, push, rate = NODE_VELOCITY, NODE_SLIP, NODE_ACCELERATION, NODE_SLIP_RATE
    table = a[NODE_TABLE], a[velocity], a[push], b[NODE_TABLE], b[velocity], b[push]
    relative = a[NODE_RELATIVE], a[slip], a[rate], b[NODE_RELATIVE], b[slip], b[rate]
    state[0], state[3] = _quintic(x, h, table), _quintic(x, h, relative)
    state[1] = _cubic(x, h, a[velocity], a[push], b[velocity], b[push])
    state[2] = _cubic(x, h, a[slip], a[rate], b[slip], b[rate])


@compiled
def _slip_block(
    parameters: Floats,
    phase: Floats,
    nodes: Floats,
    end: int,
    times: Floats,
    out: Floats,
    first: int,
) -> None:
    """Write the channels of a block within a slip, nodes up to row `end`, from column `first` on."""
    k, start = int(phase[FIRST_NODE]), phase[START] + parameters[RELEASE]
    state, slope = np.empty(4), np.empty(4)
    for j in range(len(times)):
        tau = times[j] - start
        while k + 2 < end and nodes[k + 1, NODE_TAU] < tau:
            k += 1
        _between(nodes, k, tau, state)
        out[0, first + j], out[1, first + j] = state[0], state[3]
        if len(out) == 6:
            slope_in_slip(parameters, phase[SIGN], state, slope)
            out[2, first + j], out[3, first + j] = state[1], state[1] + state[2]
            out[4, first + j], out[5, first + j] = slope[1], slope[1] + slope[2]


@compiled_part
def _nodes_end(phases: Floats, nodes: Floats, p: int) -> int:
    return int(phases[p + 1, FIRST_NODE]) if p + 1 < len(phases) else len(nodes)


@compiled
def sample_stribeck(
    parameters: Floats, phases: Floats, nodes: Floats, times: Floats, channels: int
) -> Floats:
    """Channels at sorted `times`, as `sampling.sample` gives them."""
    out = np.zeros((channels, len(times)))
    tables, basis = rotation_tables(parameters, times), np.empty((2, BLOCK))
    blocks = phase_blocks(parameters, phases, times)
    held = blocks[0, 0] if len(blocks) > 0 else len(times)
    for k in range(held):
        out[0, k] = parameters[PULLBACK]
    for b in range(len(blocks)):
        first, last, p = blocks[b, 0], blocks[b, 1], blocks[b, 2]
        phase, at = phases[p], times[first:last]
        if phase[SIGN] != 0.0:
            _slip_block(parameters, phase, nodes, _nodes_end(phases, nodes, p), at, out, first)
            continue
        block_basis(parameters, phase, at, tables, basis)
        block_displacements(parameters, phase, at, basis, out[0][first:last], out[1][first:last])
        if channels == 6:
            rates = (out[2][first:last], out[3][first:last], out[4][first:last], out[5][first:last])
            block_rates(parameters, phase, at, basis, rates)
    return out


@compiled
def peak_stribeck_rates(
    parameters: Floats, phases: Floats, nodes: Floats, duration_s: float
) -> tuple[float, float, float, float]:
    """Largest |u1'|, |u2'|, |u1''|, |u2''| until `duration_s`, in slips among four looks a step."""
    largest, state, slope = np.zeros(4), np.empty(4), np.empty(4)
    for p in range(len(phases)):
        if phases[p, SIGN] == 0.0:
            span = (phases[p + 1, START] if p + 1 < len(phases) else duration_s) - phases[p, START]
            speed, push = peak_rates_in_stick(parameters, phases[p, TABLE], phases[p, VELOCITY], span)
            _raise(largest, speed, speed, push, push)
            continue
        for k in range(int(phases[p, FIRST_NODE]), _nodes_end(phases, nodes, p) - 1):
            for look in range(5):
                tau = nodes[k, NODE_TAU] + 0.25 * look * (nodes[k + 1, NODE_TAU] - nodes[k, NODE_TAU])
                _between(nodes, k, tau, state)
                slope_in_slip(parameters, phases[p, SIGN], state, slope)
                _raise(largest, state[1], state[1] + state[2], slope[1], slope[1] + slope[2])
    return largest[0], largest[1], largest[2], largest[3]


@compiled_part
def _raise(largest: Floats, table: float, plate: float, table_push: float, plate_push: float) -> None:
    largest[0] = max(largest[0], abs(table))
    largest[1] = max(largest[1], abs(plate))
    largest[2] = max(largest[2], abs(table_push))
    largest[3] = max(largest[3], abs(plate_push))


@compiled_part
def final_stribeck_relative(phases: Floats, nodes: Floats) -> float:
    """Displacement of the plate against the table at the end of the walk."""
    last = phases[len(phases) - 1]
    relative: float = last[RELATIVE] if last[SIGN] == 0.0 else nodes[len(nodes) - 1, NODE_RELATIVE]
    return relative


@compiled_part
def _longest_step(parameters: Floats, direction: Floats) -> float:
    """Step along `direction` with which no parameter moves by more than is good for a difference."""
    step = math.inf
    for place in range(len(parameters)):
        relative = place in (STIFFNESS, DAMPING, TABLE_MASS, PLATE_MASS, GRAVITY, STRIBECK)
        most = 1e-5 * abs(parameters[place]) if relative else 1e-6
        if direction[place] != 0.0 and most > 0.0:
            step = min(step, most / abs(direction[place]))
    return step if step < math.inf else 1.0


@compiled
def sample_stribeck_with_gradient(
    parameters: Floats, times: Floats, directions: Floats
) -> tuple[Floats, Floats]:
    """u1 and u2 - u1 at sorted `times` and their differences along `directions`: (2, n) and (q, 2, n)."""
    duration = max(times[-1] - parameters[RELEASE], 1e-3) + 1e-3
    phases, nodes = integrate_stribeck(parameters, duration)
    motion = sample_stribeck(parameters, phases, nodes, times, 2)
    gradient = np.empty((len(directions), 2, len(times)))
    for d in range(len(directions)):
        step = _longest_step(parameters, directions[d])
        for side in range(2):
            moved = parameters + (1.0 - 2.0 * side) * step * directions[d]
            phases, nodes = integrate_stribeck(moved, duration)
            there = sample_stribeck(moved, phases, nodes, times, 2)
            for channel in range(2):
                for k in range(len(times)):
                    if side == 0:
                        gradient[d, channel, k] = there[channel, k]
                    else:
                        gradient[d, channel, k] = (gradient[d, channel, k] - there[channel, k]) / (2.0 * step)
    return motion, gradient
