"""The short form of the drill with random and mutated bytes."""

import pytest

from tests.drills.hostile_bytes import SPEAKERS, hostile_bytes


@pytest.mark.parametrize("speaker", SPEAKERS, ids=lambda speaker: speaker.name)
def test_rubbish_neither_harms_nor_passes_for_samples(speaker):
    report = hostile_bytes(speaker, megabytes=2.0, frames=5000, seed=7)
    assert not report.faults, str(report)
