"""A device that a test moves, and the operator's input, for calibration and check of gauges."""

import socket
import threading
import time

import numpy as np

GAIN, ZERO = -2e-6, 500.0  # m a count
RATE_HZ = 400


def counts_of(dial_mm: float) -> float:
    return dial_mm * 1e-3 / GAIN + ZERO


class Bench:
    """A device on TCP that sends lines of two counts, and the operator who moves it and types."""

    def __init__(self, lines: list[str], gain_error: float = 0.0) -> None:
        self._sensitivity = 1.0 + gain_error
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._lines = iter(lines)
        self._dial_mm = 0.0
        self._sent = 0
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._send)
        self._thread.start()

    def readline(self) -> str:
        """The next line of the operator, who has moved the table before."""
        line = next(self._lines, "")
        try:
            self._dial_mm = float(line.replace(",", "."))
        except ValueError:
            return f"{line}\n"
        sent = self._sent
        while self._sent < sent + 20 and not self._leaving.is_set():
            time.sleep(0.005)
        return f"{line}\n"

    def close(self) -> None:
        self._leaving.set()
        self._thread.join()
        self._server.close()

    def _send(self) -> None:
        self._server.settimeout(0.1)
        while not self._leaving.is_set():
            try:
                wire, _ = self._server.accept()
            except TimeoutError:
                continue
            with wire:
                self._serve(wire)

    def _serve(self, wire: socket.socket) -> None:
        """Send as many lines as are due, so that a busy computer makes none late for good."""
        random = np.random.default_rng(1)
        began_s, sent = time.monotonic(), 0
        try:
            while not self._leaving.wait(0.005):
                due = int((time.monotonic() - began_s) * RATE_HZ) - sent
                counts = counts_of(self._dial_mm * self._sensitivity) + random.normal(0.0, 0.5, due)
                wire.sendall("".join(f"7.0,{count:.3f}\r\n" for count in counts).encode())
                sent += due
                self._sent += due
        except OSError:  # the other end has gone
            return
