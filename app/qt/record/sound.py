"""Sound cues for states of a pullback test, played by a program of the system."""

import io
import shutil
import sys
import wave
from pathlib import Path

import numpy as np
import platformdirs
from PySide6.QtCore import QProcess
from PySide6.QtWidgets import QApplication

from app.presenters.record.state import Cue

_RATE_HZ = 22_050
_LOUDNESS = 0.3
_FADE_S = 0.01
_PLAYERS = (("pw-play",), ("paplay",), ("aplay", "-q"), ("afplay",))
_TUNES: dict[Cue, tuple[tuple[float, float], ...]] = {
    Cue.PULL: ((440.0, 0.12),),
    Cue.HOLD: ((587.0, 0.12), (587.0, 0.12)),
    Cue.LET_GO: ((880.0, 0.3),),
    Cue.RELEASED: ((659.0, 0.08),),
    Cue.RESULT: ((523.0, 0.12), (659.0, 0.12), (784.0, 0.2)),
    Cue.TROUBLE: ((220.0, 0.25), (196.0, 0.35)),
}
"""Frequency (Hz) and length (s) of each tone: rising towards the release, low for trouble."""


class CuePlayer:
    """Plays cues; without a player the bell of the system is used."""

    def __init__(self) -> None:
        self._folder = platformdirs.user_cache_path("slipstand", appauthor=False) / "sounds"
        self._written: set[Cue] = set()

    def play(self, cue: Cue) -> None:
        try:
            is_played = _play(self._file(cue))
        except OSError:
            is_played = False
        if not is_played:
            QApplication.beep()

    def _file(self, cue: Cue) -> Path:
        path = self._folder / f"{cue.value}.wav"
        if cue not in self._written:
            self._folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(cue_wav(cue))
            self._written.add(cue)
        return path


def cue_wav(cue: Cue) -> bytes:
    made = io.BytesIO()
    with wave.open(made, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(_RATE_HZ)
        for frequency_hz, length_s in _TUNES[cue]:
            file.writeframes(_tone(frequency_hz, length_s))
    return made.getvalue()


def _tone(frequency_hz: float, length_s: float) -> bytes:
    """Samples of one tone, faded in and out so that it does not click."""
    time_s = np.arange(round(length_s * _RATE_HZ)) / _RATE_HZ
    fade = np.minimum(1.0, np.minimum(time_s, length_s - time_s) / _FADE_S)
    samples = 32_767 * _LOUDNESS * fade * np.sin(2.0 * np.pi * frequency_hz * time_s)
    return np.rint(samples).astype("<i2").tobytes()


def _play(path: Path) -> bool:
    """Begin to play a file; False where nothing can. Raises OSError."""
    if sys.platform == "win32":
        import winsound

        winsound.PlaySound(str(path), winsound.SND_FILENAME | winsound.SND_ASYNC)
        return True
    players = [player for player in _PLAYERS if shutil.which(player[0])]
    return bool(players) and QProcess.startDetached(players[0][0], [*players[0][1:], str(path)])[0]
