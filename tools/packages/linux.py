"""Tarball and Debian package of the folder of `tools.packages.folder`."""

import gzip
import platform
import shutil
from pathlib import Path

from app.version import __version__
from tools.packages.folder import BUILD, DIST, ICON, PACKAGING, PROJECT, png_icon, run, size_mb

DEBIAN_NAME = f"slipstand_{__version__}_amd64.deb"
ARCHIVE_NAME = f"slipstand-{__version__}-linux-{platform.machine()}.tar.gz"
_DEPENDS = "libc6 (>= 2.36), libstdc++6, libgcc-s1, libegl1, libgl1, libglx0, libopengl0"
"""Drawing is left to the system, since its drivers must fit; other libraries are in the folder."""
_CONTROL = """\
Package: slipstand
Version: {version}
Architecture: amd64
Maintainer: The Slipstand maintainers <maintainers@slipstand.invalid>
Installed-Size: {kilobytes}
Depends: {depends}
Recommends: shared-mime-info, hicolor-icon-theme
Section: science
Priority: optional
Description: measures dry friction on a laboratory shaking stand
 Slipstand records pullback tests of two plates through the amplifier of the
 stand's strain gauges, keeps each sample, and identifies period, damping,
 stiffness and the dynamic friction coefficient with uncertainties. The package
 has its own Python and libraries.
"""


def make_archive(folder: Path) -> Path:
    """Pack the folder, with a text on how to use and remove it, for users who are not root."""
    target = DIST / ARCHIVE_NAME
    DIST.mkdir(exist_ok=True)
    for name in ("README.txt", "slipstand.desktop"):
        shutil.copy(PACKAGING / "linux" / name, folder)
    shutil.copy(PROJECT / "LICENSE", folder)
    shutil.copy(ICON, folder)
    name = f"s,^slipstand,slipstand-{__version__},"  # of the folder; gzip: a bare system has no other
    pack = ["tar", "--create", "--gzip", "--owner=0", "--group=0", "--transform", name, "--file", str(target)]
    run([*pack, "--directory", str(folder.parent), "slipstand"])
    return target


def make_debian_package(folder: Path, version: str = __version__, compression: str = "zstd") -> Path:
    """Pack the folder for Debian, with entry of the menu, icon, type of run files and rule of udev."""
    stage = BUILD / "debian"
    shutil.rmtree(stage, ignore_errors=True)
    library = stage / "usr" / "lib" / "slipstand"
    library.parent.mkdir(parents=True)
    shutil.copytree(folder, library, symlinks=True, copy_function=_link)
    for name in ("README.txt", "slipstand.desktop", "slipstand.svg", "LICENSE"):
        (library / name).unlink(missing_ok=True)  # of the tarball
    link = stage / "usr" / "bin" / "slipstand"
    link.parent.mkdir(parents=True)
    link.symlink_to("../lib/slipstand/slipstand")
    linux, icons = PACKAGING / "linux", "usr/share/icons/hicolor"
    for source, place in (
        (linux / "slipstand.desktop", "usr/share/applications/slipstand.desktop"),
        (linux / "slipstand.metainfo.xml", "usr/share/metainfo/slipstand.metainfo.xml"),
        (linux / "slipstand.mime.xml", "usr/share/mime/packages/slipstand.xml"),
        (ICON, f"{icons}/scalable/apps/slipstand.svg"),
        (png_icon(48), f"{icons}/48x48/apps/slipstand.png"),
        (PROJECT / "config" / "udev" / "60-slipstand.rules", "usr/lib/udev/rules.d/60-slipstand.rules"),
        (linux / "copyright", "usr/share/doc/slipstand/copyright"),
    ):
        _add(source, stage / place)
    changes = stage / "usr" / "share" / "doc" / "slipstand" / "changelog.gz"
    changes.write_bytes(gzip.compress((PROJECT / "CHANGELOG.md").read_bytes(), mtime=0))
    _write_control(stage, version)
    target = DIST / DEBIAN_NAME.replace(__version__, version)
    DIST.mkdir(exist_ok=True)
    run(["dpkg-deb", "--root-owner-group", f"-Z{compression}", "--build", str(stage), str(target)])
    return target


def _write_control(stage: Path, version: str) -> None:
    control = stage / "DEBIAN"
    control.mkdir()
    kilobytes = round(size_mb(stage) * 1e6 / 1024)
    text = _CONTROL.format(version=version, kilobytes=kilobytes, depends=_DEPENDS)
    (control / "control").write_text(text, encoding="utf-8")
    for name in ("postinst", "postrm"):
        shutil.copy(PACKAGING / "linux" / name, control)
        (control / name).chmod(0o755)


def _add(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, target)
    target.chmod(0o644)


def _link(source: str, target: str) -> None:
    """Link instead of copying some 800 MB."""
    Path(target).hardlink_to(source)
