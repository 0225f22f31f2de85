"""Records of two masses on springs without contact, which no friction law describes."""

import numpy as np

from analysis.record import Record, StandMasses


def coupled_oscillators(
    period_s, frequency_ratio, mass_ratio, damping_ratios, *, between="one on the other", rate_hz=100.0,
    duration_s=17.0, hold_s=1.0, pullback_m=0.02, noise_m=0.0, step_m=0.0
):  # fmt: skip
    """Record of a tuned mass damper, or of two carts with a spring `between` walls and each other.

    Gauge 1 reads the first mass (1 kg), gauge 2 the second one against it. Motion is exact, by eigenvectors.
    `frequency_ratio` is that of the second mass on its own spring over that of the first.
    """
    w1, (z1, z2), mu = 2.0 * np.pi / period_s, damping_ratios, mass_ratio
    w2 = frequency_ratio * w1
    to_wall = w1**2 if between == "walls" else 0.0  # spring of the second cart to its own wall
    coupling = np.array([mu * w2**2, 2.0 * mu * w2 * z2])
    first = np.array([-(w1**2), coupling[0], -2.0 * z1 * w1, coupling[1]])
    second = np.array([-to_wall, -(w2**2) - to_wall, 0.0, -2.0 * z2 * w2])
    system = np.vstack((np.eye(4)[2:], first, second - first))
    start = np.array([pullback_m, 0.0, 0.0, 0.0])
    time_s = np.arange(0.0, duration_s, 1.0 / rate_hz)
    rates, shapes = np.linalg.eig(system)
    modes = np.linalg.solve(shapes, start)[:, None] * np.exp(
        np.outer(rates, np.maximum(time_s - hold_s, 0.0))
    )
    readings = (shapes[:2] @ modes).real + noise_m * np.random.default_rng(7).standard_normal(
        (2, len(time_s))
    )
    if step_m:
        readings = np.round(readings / step_m) * step_m
    return Record(time_s, *readings, StandMasses(1.0, mass_ratio))
