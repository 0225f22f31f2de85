import datetime
from pathlib import Path

import pytest

from app.simulated_stand.campaign.tests import CampaignOptions, plan_tests
from app.simulated_stand.campaign.writing import write_test
from config.files import load_gauges, load_stand

START = datetime.datetime(2026, 11, 21, 8, 0, tzinfo=datetime.UTC)


@pytest.fixture(scope="session")
def short_runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short synthetic runs, not to be changed."""
    options = CampaignOptions(series=("1FFM0", "2SSM1"), repeats=1, rate_hz=300.0, duration_s=5.0)
    tests = plan_tests(options, load_stand(), load_gauges(), tmp_path_factory.mktemp("short"), START)
    return [Path(write_test(test).path) for test in tests]
