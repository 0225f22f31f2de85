import numpy as np
import pytest
from wire_helpers import ScriptedLink, join

from drivers.devices.slipstand_binary.codec import encode_frames
from drivers.devices.slipstand_binary.source import SlipstandBinarySource, make_source
from drivers.errors import DeviceLostError, NoDataError, ProtocolError, SettingsError
from drivers.samples import DeviceIdentity

FRAMES = 500


def frames(rate_hz: float = 500.0, first_index: int = 0) -> bytes:
    times_us = np.arange(FRAMES) * round(1e6 / rate_hz)
    counts = np.arange(2 * FRAMES).reshape(FRAMES, 2)
    return encode_frames(first_index, times_us, counts).tobytes()


class Firmware:
    """Answers as the reference firmware does."""

    def __init__(self, rate_hz: float = 500.0, obeys_rate: bool = True) -> None:
        self.rate_hz = rate_hz
        self.obeys_rate = obeys_rate

    def __call__(self, sent: bytes) -> bytes:
        if sent == b"I":
            return b"slipstand-fw 1.2 %d 2\n" % self.rate_hz
        if sent.startswith(b"R") and self.obeys_rate:
            self.rate_hz = int(sent[1:])
        return frames(self.rate_hz) if sent == b"S" else b""


@pytest.fixture(autouse=True)
def short_limit(monkeypatch):
    monkeypatch.setattr(SlipstandBinarySource, "timeout_s", 0.3)
    monkeypatch.setattr(SlipstandBinarySource, "answer_timeout_s", 0.05)
    monkeypatch.setattr("drivers.devices.slipstand_binary.source._LISTEN_S", 0.1)


def test_the_conversation_of_a_start():
    link = ScriptedLink(Firmware(), waiting=b"tail of what ran before")
    source = make_source({}, None)
    source.start(link)
    assert link.sent == [b"P", b"I", b"S"]
    assert source.identity == DeviceIdentity("slipstand-binary", "slipstand-fw", firmware="1.2")
    assert source.rate_hz == 500.0
    source.stop(link)
    assert link.sent[-1] == b"P"


def test_what_start_read_is_decoded_before_what_comes_next():
    link = ScriptedLink(Firmware())
    source = make_source({}, None)
    blocks = list(source.decode(source.start(link), 0))
    assert blocks
    while data := link.read():
        blocks += source.decode(data, 0)
    np.testing.assert_array_equal(join(blocks).counts, np.arange(2 * FRAMES).reshape(FRAMES, 2))
    assert source.losses.samples == FRAMES


def test_a_board_that_opening_its_port_has_reset_is_asked_until_it_hears():
    firmware = Firmware()
    heard = 0

    def answer(sent: bytes) -> bytes:
        nonlocal heard
        heard += 1
        return firmware(sent) if heard > 3 else b""

    link = ScriptedLink(answer)
    source = make_source({}, 2000)
    source.start(link)
    assert link.sent == [b"P", b"I", b"I", b"I", b"R2000\n", b"I", b"S"]
    assert source.rate_hz == 2000


def test_another_rate_is_set_and_confirmed():
    link = ScriptedLink(Firmware())
    source = make_source({}, 2000)
    source.start(link)
    assert link.sent == [b"P", b"I", b"R2000\n", b"I", b"S"]
    assert source.rate_hz == 2000


def test_a_rate_that_is_not_taken_is_said():
    source = make_source({}, 2000)
    with pytest.raises(ProtocolError, match="does not take 2000 Hz and stays at 500 Hz: ask for --rate 500"):
        source.start(ScriptedLink(Firmware(obeys_rate=False)))


def test_a_device_without_identity_is_taken_at_the_rate_of_its_times():
    source = make_source({}, None)
    source.start(ScriptedLink(lambda sent: frames(250.0) if sent == b"S" else b""))
    assert source.rate_hz == pytest.approx(250)
    assert source.identity.firmware == ""


def test_a_device_without_identity_at_another_rate_is_refused():
    source = make_source({}, 500)
    with pytest.raises(ProtocolError, match="sends 250 Hz where 500 Hz is asked for"):
        source.start(ScriptedLink(lambda sent: frames(250.0) if sent == b"S" else b""))


def test_a_silent_device():
    with pytest.raises(NoDataError, match="nothing came, check cable and power"):
        make_source({}, None).start(ScriptedLink(lambda _: b""))


def test_a_wrong_baud_rate_says_what_came():
    link = ScriptedLink(lambda sent: b"\x00\x1f\xa3\xff" * 128 if sent == b"S" else b"")
    with pytest.raises(
        NoDataError, match=r"received 512 bytes, first 00 1f a3 ff .*baud rate \(usual is 460800"
    ):
        make_source({}, None).start(link)


def test_lines_of_text_are_recognised():
    link = ScriptedLink(lambda sent: b"17\r\n1000,12,13\r\n2000,14,15\r\n" if sent == b"S" else b"")
    with pytest.raises(NoDataError, match="lines of text such as '1000,12,13', choose protocol csv"):
        make_source({}, None).start(link)


def test_a_device_that_goes_during_the_start_is_lost_and_stopping_it_is_quiet():
    link = ScriptedLink(Firmware())
    link.is_lost = True
    source = make_source({}, None)
    with pytest.raises(DeviceLostError):
        source.start(link)
    source.stop(link)


def read_out(source, link, first: bytes, arrival_ns: int) -> int:
    rows = 0
    for data in (first, *iter(link.read, b"")):
        rows += sum(len(block) for block in source.decode(data, arrival_ns))
    return rows


def test_a_second_start_goes_on_with_the_same_account():
    source = make_source({}, None)
    for _ in range(2):
        link = ScriptedLink(Firmware())
        read_out(source, link, source.start(link), 0)
        assert list(source.decode(b"", 0)) == []
    assert source.losses.samples == 2 * FRAMES
    assert source.losses.restarts == 1


def test_a_device_that_kept_its_power_is_not_started_again_and_tells_what_is_missing():
    source = make_source({}, None)
    link = ScriptedLink(Firmware())
    read_out(source, link, source.start(link), 0)
    list(source.decode(b"", 0))
    link = ScriptedLink(lambda _: b"", waiting=b"half a frame" + frames(first_index=FRAMES + 1000))
    rows = read_out(source, link, source.resume(link), round((1000 + 251) / 500 * 1e9))
    assert link.sent == []
    assert rows == 1000 + FRAMES
    assert (source.losses.missing, source.losses.damaged) == (999, 1)
    assert (source.losses.restarts, source.losses.missing_estimated) == (0, 0)


def test_a_device_that_lost_its_power_is_set_up_again_and_the_gap_estimated():
    source = make_source({}, 2000)
    link = ScriptedLink(Firmware())
    read_out(source, link, source.start(link), 0)
    list(source.decode(b"", 0))
    link = ScriptedLink(Firmware())
    rows = read_out(source, link, source.resume(link), 2_000_000_000)
    assert link.sent == [b"P", b"I", b"R2000\n", b"I", b"S"]
    assert source.losses.restarts == 1
    assert 4000 - 50 <= rows <= 4000 + FRAMES  # of 2 s, which those that came are part of
    assert source.losses.missing_estimated == rows - FRAMES


def test_a_device_that_sends_at_another_rate_than_before_is_set_up_again():
    source = make_source({}, None)
    link = ScriptedLink(Firmware())
    source.start(link)
    link = ScriptedLink(Firmware(250.0), waiting=frames(250.0))
    source.resume(link)
    assert link.sent == [b"P", b"I", b"R500\n", b"I", b"S"]


def test_replayed_bytes_need_no_start():
    source = make_source({}, None)
    block = join(source.decode(frames(), 0))
    assert len(block) == FRAMES
    assert source.rate_hz == pytest.approx(500)
    assert source.identity == DeviceIdentity("slipstand-binary", "Slipstand binary")


def test_the_rate_is_not_guessed_before_samples():
    with pytest.raises(ProtocolError, match="rate is not known before"):
        _ = make_source({}, None).rate_hz


def test_settings_are_checked():
    with pytest.raises(
        SettingsError, match="setting 'columns' is not known to slipstand-binary: it has none"
    ):
        make_source({"columns": "table"}, None)
    with pytest.raises(SettingsError, match="whole hertz"):
        make_source({}, 33.3)
