"""Recipes of winget, conda-forge and Homebrew for a release: `python -m tools.packages.recipes ADDRESS`.

ADDRESS is where the files of `dist` can be loaded from, without a slash at its end.
"""

import argparse
import hashlib
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

from app.version import __version__
from tools.packages.folder import DIST, PACKAGING, PROJECT
from tools.packages.windows import INSTALLER_NAME

RECIPES = ("winget", "conda-forge", "homebrew")
_NAMES_OF_CONDA = {"matplotlib": "matplotlib-base", "pyside6-essentials": "pyside6"}
"""Packages that conda-forge calls otherwise."""
_NOT_IN_CONDA = frozenset({"fontpkg-ibm-plex-sans"})
"""Have to be added there before Slipstand is."""


def main() -> int:
    """Make the archive of the sources, and write the recipes into `dist/recipes`."""
    parser = argparse.ArgumentParser(prog="python -m tools.packages.recipes", description=__doc__)
    parser.add_argument("address", metavar="ADDRESS")
    address = parser.parse_args().address
    installer = DIST / INSTALLER_NAME
    if not installer.is_file():
        sys.stderr.write(f"error: there is no {installer}. Run: make packages KINDS=windows\n")
        return 1
    for path in write_recipes(address, _sha256(make_source_archive()), _sha256(installer)):
        sys.stdout.write(f"{path}\n")
    sys.stderr.write(f"not on conda-forge: {', '.join(_NOT_IN_CONDA)}\n")
    return 0


def make_source_archive() -> Path:
    """Archive of the committed sources, which states their commit."""
    target = DIST / f"slipstand-{__version__}.tar.gz"
    DIST.mkdir(exist_ok=True)
    packed = ["git", "-C", str(PROJECT), "archive", "--format=tar.gz", f"--prefix=slipstand-{__version__}/"]
    subprocess.run([*packed, "-o", str(target), "HEAD"], check=True)
    return target


def write_recipes(address: str, source: str, installer: str, folder: Path = DIST / "recipes") -> list[Path]:
    """Fill in version, address and SHA-256 of the archive of the sources and of Windows' installer."""
    values = {
        "VERSION": __version__, "ADDRESS": address, "SOURCE_SHA256": source,
        "WINDOWS_SHA256": installer.upper(), "REQUIREMENTS": "\n".join(conda_requirements()),
    }  # fmt: skip
    written = []
    for path in sorted(path for name in RECIPES for path in (PACKAGING / name).iterdir()):
        target = folder / path.relative_to(PACKAGING)
        target.parent.mkdir(parents=True, exist_ok=True)
        text = re.sub(r"@([A-Z0-9_]+)@", lambda found: values[found[1]], path.read_text(encoding="utf-8"))
        target.write_text(text, encoding="utf-8", newline="\n")
        written.append(target)
    return written


def conda_requirements() -> Iterable[str]:
    """Lines of the recipe: what the package requires, in the words of conda."""
    stated = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    for line in stated["project"]["dependencies"]:
        requirement, _, marker = (part.strip() for part in line.partition(";"))
        name, versions = re.fullmatch(r"([\w.-]+)(.*)", requirement).groups()  # type: ignore[union-attr]
        name = name.lower()
        if "python_version < " not in marker:
            yield f"    - {_NAMES_OF_CONDA.get(name, name)} {versions}"


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


if __name__ == "__main__":
    sys.exit(main())
