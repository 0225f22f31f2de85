"""Puts the fakes of this folder (`stage.py`) within reach of the tests below it."""

import pytest


@pytest.fixture(autouse=True)
def cache_folder(tmp_path_factory, monkeypatch):
    """A cache folder of the test's own, so that no index is left in the user's."""
    place = tmp_path_factory.mktemp("cache")
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_arguments, **_options: str(place))
    return place
