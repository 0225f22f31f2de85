"""Builds the wheel: the packages of the checkout as parts of one package, `slipstand`.

In a checkout `app`, `analysis`, `config`, `drivers` and `messages` are packages of their own. Installed under
these names they would collide with packages of others, so that the wheel holds them as `slipstand.app` and so
on, and their imports of each other are rewritten (docs/decisions/0033-one-package.md). An editable
installation leaves everything as it is.
"""

import ast
import os
import subprocess
import sys
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

PACKAGES = ("app", "analysis", "config", "drivers", "messages")
DATA = {
    "config": ["*.toml", "*.csv", "udev/*.rules"],
    "messages": ["locale/*/LC_MESSAGES/*.mo"],
    "drivers": ["devices/modbus/maps/*.toml", "devices/csv_lines/presets/*.toml"],
    "app": ["commit.txt", "qt/*.qss", "qt/*.svg", "reports/figures/*.mplstyle", "reports/test_report/*.typ"],
}
ROOT = Path(__file__).parent
IS_EDITABLE = "editable_wheel" in sys.argv


def qualified(name: str) -> str | None:
    """The name of one of our modules in the wheel; None for any other text.

    A text that ends in a dot is the beginning of such a name.
    """
    parts = name.removesuffix(".").split(".")
    path = ROOT.joinpath(*parts)
    if parts[0] not in PACKAGES or not (path.is_dir() or path.with_suffix(".py").is_file()):
        return None
    return f"slipstand.{name}"


def renamed_modules(source: str, file: str) -> list[tuple[int, int, str, str]]:
    """What is to be replaced in a source: line, column in bytes, old text, and text in the wheel.

    Those are imports, and texts that are a dotted name of a module or the beginning of one. Raises
    ValueError for an import that cannot be renamed.
    """
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and (new := qualified(node.module or "")):
            found.append((node.lineno, node.col_offset + len("from "), str(node.module), new))
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if not (new := qualified(alias.name)):
                    continue
                old, new = f"import {alias.name}", f"from slipstand import {alias.name}"
                if len(node.names) > 1 or "." in alias.name:
                    raise ValueError(f"{file}:{node.lineno}: write `from PACKAGE import MODULE`")
                found.append((node.lineno, node.col_offset, old, new))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "." in node.value:
            new = qualified(node.value)
            found += [(node.lineno, node.col_offset, node.value, new)] if new else []
    return found


def rewrite(source: str, file: str) -> str:
    """The source with our modules under their names in the wheel."""
    lines = [line.encode() for line in source.splitlines(keepends=True)]
    for number, column, old, new in sorted(renamed_modules(source, file), reverse=True):
        line = lines[number - 1]
        at = line.index(old.encode(), column)
        lines[number - 1] = line[:at] + new.encode() + line[at + len(old.encode()) :]
    return b"".join(lines).decode()


class BuildPackages(build_py):
    """Copies modules, and renames what they import."""

    def build_module(self, module: str, module_file: str, package: str) -> tuple[str, bool]:
        """Copy one module into the package `slipstand`."""
        target, copied = super().build_module(module, module_file, package)
        if not IS_EDITABLE:
            path = Path(target)
            path.chmod(0o644)
            path.write_text(rewrite(Path(module_file).read_text("utf-8"), module_file), encoding="utf-8")
        return target, copied

    def build_package_data(self) -> None:
        """Copy the data, and write the commit that the package is made of."""
        super().build_package_data()
        if not IS_EDITABLE and (commit := built_commit()):
            Path(self.build_lib, "slipstand", "app", "commit.txt").write_text(f"{commit}\n", encoding="utf-8")


def built_commit() -> str:
    """SLIPSTAND_COMMIT, else the commit of the checkout; "" for an archive of sources, which has its own."""
    if "SLIPSTAND_COMMIT" in os.environ or not (ROOT / ".git").exists():
        return os.environ.get("SLIPSTAND_COMMIT", "")
    described = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude=*", "--abbrev=12"]
    try:
        return subprocess.run(described, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def build() -> None:
    """Build what setuptools was asked for."""
    prefix = "" if IS_EDITABLE else "slipstand."
    included = [f"{name}{end}" for name in PACKAGES for end in ("", ".*")]
    setup(
        packages=["slipstand", *(prefix + name for name in find_packages(str(ROOT), include=included))],
        package_dir={} if IS_EDITABLE else {prefix + name: name for name in PACKAGES},
        package_data={"slipstand": ["py.typed"]} | {prefix + name: data for name, data in DATA.items()},
        cmdclass={"build_py": BuildPackages},
    )


if __name__ == "__main__":
    build()
