"""The short form of the drill with random and mutated bytes."""

import pytest

from tests.drills.hostile_bytes import hostile_bytes
from tests.drills.speakers import SPEAKERS


@pytest.mark.parametrize("speaker", SPEAKERS)
def test_rubbish_neither_harms_nor_passes_for_samples(speaker):
    report = hostile_bytes(SPEAKERS[speaker], megabytes=2.0, frames=5000, seed=7)
    assert not report.faults, str(report)
