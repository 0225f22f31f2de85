"""The system calls by which a program changes files, logged by strace in the order of their ends."""

import codecs
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

_CALLS = (
    "openat,write,pwrite64,fsync,fdatasync,rename,renameat,renameat2,link,linkat,unlink,unlinkat,ftruncate,"
    "truncate,fallocate,mkdir,mkdirat,rmdir,lseek,sendfile,copy_file_range,writev,pwritev,pwritev2"
)
_LINE = re.compile(rb"^(\d+\.\d+) (\w+)\((.*)\) += (-?\d+)(?:<[^>]*>)?.*<(\d+\.\d+)>$")
_TEXT = re.compile(rb'"((?:[^"\\]|\\.)*)"')
_FILE = re.compile(rb"^(AT_FDCWD|\d+)<(/[^>]*)>")


@dataclass(frozen=True, slots=True)
class SystemCall:
    """One call that succeeded."""

    start_s: float
    end_s: float
    name: str
    arguments: str
    """As strace prints them, without the texts."""
    texts: tuple[bytes, ...]
    """Paths, or the bytes that were written."""
    result: int
    folder_or_file: str
    """Path of the first argument that is a descriptor, empty for none."""


def has_strace() -> bool:
    """Tell whether strace is there and may be used."""
    program = shutil.which("strace")
    return (
        program is not None
        and subprocess.run([program, "-qq", "-e", "trace=none", "true"], check=False).returncode == 0
    )


def log_calls(command: Sequence[str], folder: Path) -> list[SystemCall]:
    """Run a command with all its children under strace; `folder` is an empty one for the logs.

    Raises subprocess.CalledProcessError if the command fails.
    """
    strace = ["strace", "-f", "-ff", "--seccomp-bpf", "-qq", "-y", "-s", str(1 << 26)]
    times = ["--absolute-timestamps=unix,ns", "--syscall-times=ns"]
    output = ["-o", str(folder / "calls"), "-e", f"trace={_CALLS}", "-e", "signal=none"]
    subprocess.run([*strace, *times, *output, *command], check=True)
    calls = [call for path in folder.iterdir() for call in _calls(path)]
    return sorted(calls, key=lambda call: call.end_s)


def _calls(path: Path) -> Iterator[SystemCall]:
    for line in path.read_bytes().splitlines():
        match = _LINE.match(line)
        if match is None:
            continue
        start, name, inside, result, duration = match.groups()
        if int(result) < 0:
            continue
        first = _FILE.match(inside)
        yield SystemCall(
            start_s=float(start),
            end_s=float(start) + float(duration),
            name=name.decode(),
            arguments=_TEXT.sub(b'""', inside).decode(errors="replace"),
            texts=tuple(codecs.escape_decode(text)[0] for text in _TEXT.findall(inside)),
            result=int(result),
            folder_or_file=first[2].decode() if first else "",
        )
