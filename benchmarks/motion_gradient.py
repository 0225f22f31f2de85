"""Displacements with their derivatives at single times, from the phase responses that a fit sums up."""

import numpy as np

from analysis.arrays import Floats
from analysis.compiled import compiled, compiled_part
from analysis.motion.events import PULLBACK, RELEASE, SIGN, START
from analysis.motion.sampling import (
    BLOCK,
    block_basis,
    block_displacements,
    phase_blocks,
    phase_responses,
    rotation_tables,
)


@compiled_part
def _block_gradient(
    row: Floats, joint: bool, start: float, times: Floats, basis: Floats, table: Floats, relative: Floats
) -> None:
    """Write the change of u1 and u2 - u1 in a block, from the row of its phase."""
    d_load, d_drive, pc, ps, qc, qs = row[4], row[5], row[6], row[7], row[8], row[9]
    cosines, sines = basis[0], basis[1]
    for k in range(len(times)):
        tau = times[k] - start
        table[k] = d_load + ((pc + qc * tau) * cosines[k] + (ps + qs * tau) * sines[k])
    if joint:
        for k in range(len(times)):
            relative[k] = row[3]
        return
    offset, speed = row[3] + row[0], row[2]
    for k in range(len(times)):
        tau = times[k] - start
        relative[k] = (offset - table[k]) + (speed + 0.5 * d_drive * tau) * tau


@compiled
def sample_with_gradient(
    parameters: Floats, phases: Floats, times: Floats, directions: Floats
) -> tuple[Floats, Floats]:
    """u1 and u2 - u1, and their derivatives along `directions`; (2, n) and (q, 2, n)."""
    motion, gradient = np.empty((2, len(times))), np.empty((len(directions), 2, len(times)))
    rows = phase_responses(parameters, phases, directions)
    tables, basis = rotation_tables(parameters, times), np.empty((2, BLOCK))
    blocks = phase_blocks(parameters, phases, times)
    held = blocks[0, 0] if len(blocks) > 0 else len(times)
    for k in range(held):
        motion[0, k], motion[1, k] = parameters[PULLBACK], 0.0
        for d in range(len(directions)):
            gradient[d, 0, k], gradient[d, 1, k] = directions[d, PULLBACK], 0.0
    for b in range(len(blocks)):
        first, last, phase = blocks[b, 0], blocks[b, 1], phases[blocks[b, 2]]
        at, start = times[first:last], phase[START] + parameters[RELEASE]
        block_basis(parameters, phase, at, tables, basis)
        block_displacements(parameters, phase, at, basis, motion[0][first:last], motion[1][first:last])
        for d in range(len(directions)):
            row, both = rows[d, blocks[b, 2]], gradient[d]
            _block_gradient(
                row, phase[SIGN] == 0.0, start, at, basis, both[0][first:last], both[1][first:last]
            )
    return motion, gradient
