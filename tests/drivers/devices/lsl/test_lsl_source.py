from dataclasses import replace

import numpy as np
import pytest
from wire_helpers import ScriptedLink, join, refusal

from drivers import lsl_link
from drivers.devices.lsl.source import LslSource, make_source, recognise
from drivers.errors import NoDataError, PortUnavailableError, ProtocolError, SettingsError
from drivers.port import list_streams, open_port
from drivers.samples import DeviceIdentity
from drivers.stream_packets import DESCRIBE, StreamDescription, pack_chunk, pack_description

DESCRIPTION = StreamDescription("stand", "Displacement", "rig-7", "lab-pc", 3, 500.0, ("x", "y", "z"))
VALUES = np.arange(300.0).reshape(100, 3)


def sent(description: StreamDescription = DESCRIPTION) -> bytes:
    chunk = pack_chunk(7 + np.arange(100) / 500, VALUES[:, : description.channels], 0.0, 0)
    return pack_description(description, 0) + chunk


def link_to(description: StreamDescription = DESCRIPTION) -> ScriptedLink:
    return ScriptedLink(lambda asked: sent(description) if asked == DESCRIBE else b"")


@pytest.fixture(autouse=True)
def short_limit(monkeypatch):
    monkeypatch.setattr(LslSource, "timeout_s", 0.2)


def test_the_description_gives_rate_and_identity():
    link = link_to()
    source = make_source({"table": "2", "relative": "0"}, None)
    block = join(source.decode(source.start(link), 0))
    assert link.sent == [DESCRIBE]
    assert source.rate_hz == 500.0
    facts = {"host": "lab-pc", "type": "Displacement"}
    assert source.identity == DeviceIdentity("lsl", "stand", serial_number="rig-7", settings=facts)
    np.testing.assert_array_equal(block.counts, VALUES[:, [2, 0]])
    source.stop(link)
    assert link.sent == [DESCRIBE]


def test_replayed_bytes_need_no_start():
    source = make_source({}, None)
    np.testing.assert_array_equal(join(source.decode(sent(), 0)).counts, VALUES[:, :2])
    assert source.rate_hz == 500.0


@pytest.mark.parametrize(
    ("settings", "rate_hz", "change", "fault"),
    [
        (
            {"relative": "3"},
            None,
            {},
            "stream stand has channels 0 to 2, and the relative gauge is to be on 3",
        ),
        ({}, 800.0, {}, "has 500 Hz where 800 Hz is expected: ask for --rate 500"),
        ({}, None, {"rate_hz": 0.0}, "does not tell its rate: give it with --rate"),
    ],
)
def test_what_does_not_fit_is_said(settings, rate_hz, change, fault):
    with pytest.raises(ProtocolError, match=fault):
        make_source(settings, rate_hz).start(link_to(replace(DESCRIPTION, **change)))


def test_an_irregular_stream_has_the_rate_that_is_given():
    source = make_source({}, 500.0)
    source.start(link_to(replace(DESCRIPTION, rate_hz=0.0)))
    assert source.rate_hz == 500.0


def test_a_stream_without_samples_is_silent():
    with pytest.raises(NoDataError):
        make_source({}, None).start(ScriptedLink(lambda _: pack_description(DESCRIPTION, 0)))


@pytest.mark.parametrize(
    ("settings", "rate_hz", "fault"),
    [
        (
            {"channel": "1"},
            None,
            "setting 'channel' is not known to lsl: allowed are table, relative, overload",
        ),
        ({"table": "1"}, None, "table and relative are both channel 1"),
        ({"overload": "0"}, None, "overload 0 must be positive: give a larger one"),
        ({}, float("inf"), "rate inf Hz cannot be"),
    ],
)
def test_settings_are_checked(settings, rate_hz, fault):
    assert fault in refusal(make_source, settings, rate_hz)


def test_a_stream_is_recognised_by_its_description():
    found = recognise(sent(), 0.2)
    assert (found.protocol, found.channels, found.rate_hz, found.needs_rate) == ("lsl", 2, 500.0, False)
    assert "(0 x, 1 y, 2 z)" in str(found.remark)
    irregular = replace(DESCRIPTION, rate_hz=0.0, channels=1, labels=())
    found = recognise(sent(irregular), 0.2)
    assert (found.channels, found.needs_rate) == (1, True)
    assert recognise(pack_description(DESCRIPTION, 0), 0.2) is None


@pytest.mark.parametrize(
    ("url", "condition"),
    [
        ("lsl://rig-7", "(name='rig-7' or source_id='rig-7')"),
        ("lsl://My%20rig?type=Force", "(name='My rig' or source_id='My rig') and type='Force'"),
        ("lsl://?type=Force", "type='Force'"),
        ("lsl://the%27rig", '(name="the\'rig" or source_id="the\'rig")'),
    ],
)
def test_an_address_names_a_stream(url, condition):
    assert lsl_link._predicate(url) == condition


@pytest.mark.parametrize("url", ["lsl://", "lsl://rig?name=x"])
def test_an_address_of_nothing_is_refused(url):
    with pytest.raises(SettingsError, match="is no stream: give lsl://NAME"):
        lsl_link._predicate(url)


def test_without_pylsl_streams_are_not_listed_and_the_remedy_is_said(monkeypatch):
    def fail(_: str):
        raise ImportError("No module named 'pylsl'")

    monkeypatch.setattr(lsl_link.importlib, "import_module", fail)
    assert list_streams() == []
    with pytest.raises(PortUnavailableError, match=r"need pylsl .*: pip install 'slipstand\[lsl\]'"):
        open_port("lsl://rig-7", 0)
