"""Bare Debian to try packages in: a folder made once, and what a trial changes in a layer above it."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from tools.windows.environment import EnvironmentMissingError

SUITES = ("bookworm", "trixie")
"""Debian 12 and 13."""
USER = "lab"
_VARIABLES = {"PATH": "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin", "DEBIAN_FRONTEND": "noninteractive"}
_ENTER = (
    'mount -t overlay overlay -o "lowerdir=$0,upperdir=$1,workdir=$2" "$3";'
    ' for folder in dev sys; do mount --rbind /$folder "$3/$folder"; done; mount -t proc proc "$3/proc";'
    ' mkdir -p "$3/dist"; mount --bind "$4" "$3/dist"; where="$3"; shift 4; exec chroot "$where" "$@"'
)
"""Runs in a name space of its own, with which its mounts and processes end."""


class BareDebian:
    """A minimal Debian, without Python and without a display. It needs root, debootstrap and overlayfs."""

    def __init__(self, folder: Path, suite: str, dist: Path) -> None:
        self.suite = suite
        self.root = folder / suite
        self.layer, self._work, self._merged = (
            folder / f"{suite}.{part}" for part in ("layer", "work", "merged")
        )
        self._dist = dist

    def prepare(self) -> None:
        """Make the system if it is not there, and forget what earlier trials changed."""
        if os.name != "posix" or os.geteuid() != 0 or shutil.which("debootstrap") is None:
            raise EnvironmentMissingError("needs Linux, root and debootstrap: apt-get install debootstrap")
        if not (self.root / "made").exists():
            listed = ["apt-get", "indextargets", "--format", "$(SITE)", "Created-By: Packages"]
            sites = subprocess.run(listed, check=True, capture_output=True, text=True).stdout
            making = ["debootstrap", "--variant=minbase", self.suite, str(self.root), sites.split()[0]]
            subprocess.run(making, check=True, capture_output=True)
            refuse = self.root / "usr" / "sbin" / "policy-rc.d"  # no service is started inside
            refuse.write_text("#!/bin/sh\nexit 101\n")
            refuse.chmod(0o755)
            (self.root / "made").touch()
        shutil.copy("/etc/resolv.conf", self.root / "etc" / "resolv.conf")
        for folder in (self.layer, self._work, self._merged):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
        self.run(["sh", "-c", f"useradd --create-home {USER}; apt-get update -qq"])

    def run(
        self, command: Sequence[str], user: str = "root", display: str | None = None, timeout_s: float = 900.0
    ) -> "subprocess.CompletedProcess[str]":
        """Run a command inside, with `dist` at /dist; all that it starts ends with it."""
        home = "/root" if user == "root" else f"/home/{user}"
        variables = _VARIABLES | {"HOME": home} | ({"DISPLAY": display} if display else {})
        settings = [f"{name}={value}" for name, value in variables.items()]
        place = ["sh", "-c", 'cd "$HOME"; exec "$@"', "sh"]
        account = [] if user == "root" else ["setpriv", f"--reuid={user}", f"--regid={user}", "--init-groups"]
        layers = (self.root, self.layer, self._work, self._merged, self._dist)
        return subprocess.run(
            ["nice", "-n", "5", "unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", _ENTER,
             *map(str, layers), *account, "env", "-i", *settings, *place, *command],
            timeout=timeout_s, check=False, capture_output=True, text=True, errors="replace",
        )  # fmt: skip

    def traces(self, word: str = "slipstand") -> list[str]:
        """Paths in the layer that have a word in their name, with what lies below them left out."""
        found: list[Path] = []
        for folder, folders, files in os.walk(self.layer):
            named = [name for name in (*folders, *files) if word in name.lower()]
            found += [Path(folder, name) for name in named]
            folders[:] = [name for name in folders if name not in named]
        return sorted(str(Path("/", path.relative_to(self.layer))) for path in found if not _is_deleted(path))


def _is_deleted(path: Path) -> bool:
    """Tell whether an overlay marks a path as deleted, by a device of number 0."""
    return not path.is_symlink() and path.is_char_device() and path.stat().st_rdev == 0
