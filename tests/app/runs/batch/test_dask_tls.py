"""A Dask cluster that is encrypted: a scheduler and two workers, each side with a certificate made here."""

import contextlib
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.waiting import PATIENCE_S, wait_until

pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates"),
]

_SETTING = "DASK_DISTRIBUTED__COMM__TLS__"


def make_certificate(folder: Path) -> dict[str, Path]:
    """Make a certificate authority, and a certificate by it that both sides show."""
    authority, authority_key = folder / "ca.pem", folder / "ca-key.pem"
    request, certificate, key = folder / "request.pem", folder / "cert.pem", folder / "key.pem"
    names = folder / "names"
    names.write_text("subjectAltName=IP:127.0.0.1,DNS:localhost\n")

    def openssl(command: str, *paths: object) -> None:
        subprocess.run(["openssl", *command.split(), *map(str, paths)], check=True, capture_output=True)

    new = "req -nodes -newkey rsa:2048 -subj /CN=slipstand-test"
    openssl(f"{new} -x509 -days 2", "-keyout", authority_key, "-out", authority)
    openssl(new, "-keyout", key, "-out", request)
    openssl("x509 -req -days 2 -CAcreateserial", "-in", request, "-CA", authority, "-CAkey", authority_key,
            "-extfile", names, "-out", certificate)  # fmt: skip
    return {"ca-file": authority, "cert": certificate, "key": key}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, dict[str, Path]]]:
    """Address of the scheduler, and the files that a client needs."""
    folder = tmp_path_factory.mktemp("tls")
    files = make_certificate(folder)
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = f"tls://127.0.0.1:{free.getsockname()[1]}"
    options = [text for name, path in files.items() for text in (f"--tls-{name}", str(path))]

    def start(kind: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *arguments, *options]
        log = (folder / f"{kind}.log").open("ab")
        running.callback(log.close)
        process = subprocess.Popen([*command, "--no-dashboard"], stdout=log, stderr=log, cwd=folder)
        running.callback(process.wait, PATIENCE_S)
        running.callback(process.terminate)
        return process

    with contextlib.ExitStack() as running:
        start("scheduler", "--host", address.rpartition(":")[0], "--port", address.rpartition(":")[2])
        for _ in range(2):
            start("worker", address, "--nthreads", "1", "--no-nanny")
        registered = folder / "scheduler.log"
        wait_until(lambda: registered.exists() and registered.read_text().count("Register worker") == 2)
        yield address, files


def analyze(run: Path, address: str, settings: dict[str, str]) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "app", "analyze", str(run), "--dask", address]
    return subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, **settings}, check=False
    )


def test_runs_are_analysed_by_workers_that_are_reached_with_a_certificate(cluster, short_runs):
    address, files = cluster
    names = {"ca-file": "CA_FILE", "cert": "CLIENT__CERT", "key": "CLIENT__KEY"}
    settings = {f"{_SETTING}{names[name]}": str(path) for name, path in files.items()}
    done = analyze(short_runs[0], address, settings)
    assert (done.returncode, done.stderr) == (0, "")
    assert "f_d" in done.stdout


def test_who_has_no_certificate_is_refused_in_one_line(cluster, short_runs):
    address, _ = cluster
    refused = analyze(short_runs[0], address, {})
    assert refused.returncode == 1
    assert refused.stdout == ""
    assert len(refused.stderr.splitlines()) == 1
    assert "asks for a certificate" in refused.stderr
