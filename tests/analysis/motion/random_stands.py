"""Random stands for the tests of the motion, far beyond what a laboratory has."""

import numpy as np

from analysis.motion.two_mass import TwoMassParameters, stiffness_and_damping


def ordinary(rng: np.random.Generator) -> TwoMassParameters:
    """Any masses, periods and frictions; half of them with static friction, half with tilt."""
    friction = rng.uniform(0.0, 0.4)
    return _stand(rng, friction, plate_mass_kg=rng.uniform(1.0, 200.0))


def slippery(rng: np.random.Generator) -> TwoMassParameters:
    """Hardly any friction."""
    return _stand(rng, 10 ** rng.uniform(-9, -1), plate_mass_kg=rng.uniform(1.0, 200.0))


def heavy(rng: np.random.Generator) -> TwoMassParameters:
    """Plates up to a hundred tonnes."""
    return _stand(rng, rng.uniform(0.0, 0.4), plate_mass_kg=10 ** rng.uniform(0, 5))


def steep(rng: np.random.Generator) -> TwoMassParameters:
    """Tilted until static friction only just holds the plate."""
    stand = ordinary(rng)
    share = rng.choice([1.0, 1.0 - 1e-15, 1.0 - 1e-9, 0.999]) * rng.choice([-1.0, 1.0])
    return _changed(stand, tilt_rad=float(share * stand.static_or_dynamic))


def on_the_brink(rng: np.random.Generator) -> TwoMassParameters:
    """Pulled back so far that the release only just makes the plate slip, or does not."""
    stand = ordinary(rng)
    limit = stand.gravity_m_per_s2 * (stand.static_or_dynamic + stand.tilt_rad)
    mass = stand.table_mass_kg + stand.plate_mass_kg
    nudge = rng.choice([1.0, 1.0 + 1e-15, 1.0 - 1e-15, 1.0 + 1e-12, 1.0 + 1e-9])
    return _changed(stand, pullback_m=float(-nudge * limit * mass / stand.stiffness_n_per_m))


KINDS = (ordinary, ordinary, slippery, heavy, steep, on_the_brink)


def _stand(rng: np.random.Generator, friction: float, plate_mass_kg: float) -> TwoMassParameters:
    table_mass_kg = rng.uniform(50.0, 300.0)
    stiffness, damping = stiffness_and_damping(
        10 ** rng.uniform(-1.3, 0.3),
        10 ** rng.uniform(-3.0, 0.7),
        table_mass_kg=table_mass_kg,
        plate_mass_kg=plate_mass_kg,
    )
    static = friction * (1.0 if rng.random() < 0.5 else rng.uniform(1.0, 3.0))
    tilt = 0.0 if rng.random() < 0.5 else float(np.clip(rng.uniform(-0.01, 0.01), -static, static))
    return TwoMassParameters(
        table_mass_kg=table_mass_kg,
        plate_mass_kg=plate_mass_kg,
        stiffness_n_per_m=stiffness,
        damping_coefficient_kg_per_s=min(damping, np.sqrt(stiffness * table_mass_kg)),
        friction_dynamic=friction,
        friction_static=static,
        tilt_rad=tilt,
        pullback_m=rng.uniform(-0.02, 0.02),
    )


def _changed(stand: TwoMassParameters, **changes: float) -> TwoMassParameters:
    return TwoMassParameters(**{**vars(stand), **changes})
