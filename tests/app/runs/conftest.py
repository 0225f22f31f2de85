import datetime

import pytest

from app.runs.metadata import Conditions, RunMetadata, create_metadata
from config.files import load_gauges, load_stand
from config.schema import GaugeCheck
from drivers.samples import DeviceIdentity

START = datetime.datetime(
    2026, 11, 21, 14, 32, 5, 250_000, tzinfo=datetime.timezone(datetime.timedelta(hours=1))
)
CHECK = GaugeCheck(
    "relative", START, True, 0.010, 0.010_013, 3e-5, load_gauges().relative.gain_m_per_count, (), "SIM-2",
    "displacement", "gauge block 10 mm", "Ada Weiß", "slipstand-fw"
)  # fmt: skip


@pytest.fixture(scope="session")
def metadata() -> RunMetadata:
    """A run of the shipped stand with everything known."""
    return create_metadata(
        load_stand(),
        load_gauges(),
        START,
        series="1FFM1",
        operator="Ada Weiß",
        note="after re-centring\nthe plate",
        conditions=Conditions(21.5, 48.0, "P-1", "C-7", "acetone", 3, {"weather": "dry"}),
        device=DeviceIdentity("slipstand-binary", "slipstand-fw", "1.2", "SN 5", {"separator": ";"}),
        port="/dev/ttyUSB0 0403:6001 A12",
        rate_hz=500.0,
        host="bench",
        gauge_checks=(CHECK,),
        truth={"friction_dynamic": 0.1, "phases": 7, "method": "exact"},
    )
