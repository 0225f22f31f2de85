import board_kit
import pytest


@pytest.fixture(scope="session")
def workshop(tmp_path_factory):
    reason = board_kit.missing_tools()
    if reason:
        pytest.skip(reason)
    return board_kit.Workshop(tmp_path_factory.mktemp("firmware"))
