"""Loads what an identification needs, and compiles it on a first start, before anybody waits for a result."""

from analysis.identify import identify
from analysis.synthetic import Truth, simulate_record


def warm_up() -> None:
    """Identify a simulated record."""
    identify(simulate_record(Truth(rate_hz=500.0, duration_s=8.0)))
