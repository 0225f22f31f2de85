import pytest

from app.runs.exchange import storing


@pytest.fixture
def short_records(monkeypatch):
    """Tables of a few rows, in which each cell is checked, count as records."""
    monkeypatch.setattr(storing, "SAMPLES_MIN", 1)
