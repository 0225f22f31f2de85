"""Whether a saved analysis still stands: hashes of what it was made from."""

import hashlib

import h5py
import msgspec

from app.runs import format as names
from app.runs.facts import read_metadata
from app.runs.format import read_number
from app.runs.metadata import RunMetadata
from config.schema import Gauge


def metadata_hash(file: h5py.File, metadata: RunMetadata | None = None, **masses_kg: float | None) -> str:
    """Hash of all that an analysis takes of a run beside its samples, which never change.

    Parameters
    ----------
    file
        An open run.
    metadata
        What `read_metadata` gives of it, where that has been read already.
    masses_kg
        `table_mass_kg`, `plate_mass_kg`: what stood for the run's own in the analysis.

    Raises
    ------
    DamagedRunError
    """
    metadata = metadata or read_metadata(file)
    given = {name: mass for name, mass in masses_kg.items() if mass is not None}
    clock = [read_number(file, path) for path in (names.CLOCK_SCALE, names.CLOCK_SCALE_UNCERTAINTY)]
    facts = [*_facts(metadata.replace(**given) if given else metadata), *clock]
    return hashlib.blake2b(msgspec.json.encode(facts), digest_size=16).hexdigest()


def _facts(metadata: RunMetadata) -> list[object]:
    stand = metadata.stand
    return [
        metadata.table_mass_kg,
        metadata.plate_mass_kg,
        metadata.pullback_m,
        stand.table_mass_standard_uncertainty_kg,
        stand.plate_mass_standard_uncertainty_kg,
        stand.gravity_m_per_s2,
        stand.gravity_standard_uncertainty_m_per_s2,
        *_calibration(metadata.gauges.table),
        *_calibration(metadata.gauges.relative),
    ]


_ABOUT = (
    "serial_number",
    "reference",
    "date",
    "valid_until",
    "certificate",
    "calibrated_by",
    "hysteresis_m",
    "repeatability_m",
)


def _calibration(gauge: Gauge) -> list[object]:
    """What a gauge says of readings; who calibrated it, and until when it holds, changes no number.

    A line adds nothing for its polynomial, so that analyses from before there were any still stand.
    """
    about = _ABOUT if gauge.polynomial else (*_ABOUT, "polynomial")
    return [getattr(gauge, name) for name in gauge.__struct_fields__ if name not in about]
