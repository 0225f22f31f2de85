"""The wheel, installed into an environment that knows nothing of the checkout."""

import csv
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).resolve().parents[2]
STRANGER = Path(__file__).with_name("stranger.py")
PACKAGES = ("app", "analysis", "config", "drivers", "messages")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built from a copy, in which no earlier build has left anything."""
    copy, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in (*PACKAGES, "slipstand"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    build = ["wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "-w", folder, copy]
    subprocess.run([sys.executable, "-m", "pip", *build], check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory) -> Path:
    """An interpreter with the wheel and our dependencies, but without the checkout."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False)
    interpreter = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    known = [interpreter, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = Path(subprocess.run(known, check=True, capture_output=True, text=True).stdout.strip())
    # Links in a folder that is named by a link are not followed: that of the checkout is one.
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib"), "utf-8")
    install = ["--python", interpreter, "install", "--quiet", "--no-deps", "--no-index", wheel]
    subprocess.run([sys.executable, "-m", "pip", *install], check=True, capture_output=True)
    return interpreter


def run(python: Path, *arguments: object, cwd: Path) -> str:
    known = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [python, *map(str, arguments)], capture_output=True, text=True, env=known, cwd=cwd, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_has_one_top_level_package(wheel) -> None:
    with ZipFile(wheel) as archive:
        names = {name.partition("/")[0] for name in archive.namelist()}
        scripts = archive.read(next(n for n in archive.namelist() if n.endswith("entry_points.txt"))).decode()
    assert {name for name in names if not name.endswith(".dist-info")} == {"slipstand"}
    assert "slipstand = slipstand.__main__:main" in scripts


@pytest.mark.timeout(1800)  # compiles all anew, on a busy computer
def test_a_stranger_gets_the_numbers_of_the_command_line(python, tmp_path, slipstand) -> None:
    slipstand("simulate", "--series", "2SSM1", "-o", tmp_path / "run.h5")
    (by_command,) = slipstand("analyze", tmp_path / "run.h5", "--json").json
    own = tmp_path / "own"
    own.mkdir()
    (own / "config.py").write_text("LABORATORY = 'B2'\n")
    shutil.copy(STRANGER, own)
    found = json.loads(run(python, own / "stranger.py", tmp_path, cwd=own))
    assert Path(found["package"]).is_relative_to(python.parent.parent)
    assert (found["own_config"], found["names"]) == ("B2", [])
    friction = by_command["results"]["friction_dynamic"]
    assert found["friction"] == found["pooled"] == friction["value"]
    assert found["standard_uncertainty"] == friction["standard_uncertainty"]
    assert found["by_arrays"] == pytest.approx(0.1, rel=1e-3)
    assert found["warnings"] == [one["code"] for one in by_command["warnings"]]
    (repeated,) = json.loads(
        run(python, "-m", "slipstand", "analyze", tmp_path / "run.h5", "--json", cwd=own)
    )
    assert repeated["results"] == by_command["results"]
    command = python.with_name("slipstand.exe" if os.name == "nt" else "slipstand")
    (installed,) = json.loads(run(command, "analyze", tmp_path / "run.h5", "--json", cwd=own))
    assert installed["results"] == by_command["results"]
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    exported = csv.DictReader((tmp_path / "results.csv").read_text().splitlines())
    value = next(row for row in exported if "friction_dynamic" in row.values())["value"]
    assert float(value) == friction["value"]


def test_its_types_are_checked_from_outside(python, tmp_path) -> None:
    (tmp_path / "config.py").write_text("LABORATORY = 'B2'\n")
    shutil.copy(STRANGER, tmp_path)
    options = ["--strict", "--follow-imports=silent", "--python-executable", python]
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", *options, "stranger.py"],
        capture_output=True, text=True, cwd=tmp_path, check=False,
    )  # fmt: skip
    assert checked.returncode == 0, checked.stdout


def test_names_of_modules_are_renamed_wherever_they_stand() -> None:
    spec = importlib.util.spec_from_file_location("slipstand_setup", ROOT / "setup.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    rewrite = module.rewrite
    source = (
        "import config\n"
        "from analysis.record import Record\n"
        "from messages import i18n\n"
        "import numpy\n"
        "def load(name):\n"
        "    from app.cli import run\n"
        "    return spawn('app.runs.validator'), f'app.cli.doctor.{name}', 'analysis', 'config.not_there'\n"
    )
    assert rewrite(source, "a.py") == (
        "from slipstand import config\n"
        "from slipstand.analysis.record import Record\n"
        "from slipstand.messages import i18n\n"
        "import numpy\n"
        "def load(name):\n"
        "    from slipstand.app.cli import run\n"
        "    return spawn('slipstand.app.runs.validator'), f'slipstand.app.cli.doctor.{name}', 'analysis',"
        " 'config.not_there'\n"
    )
    with pytest.raises(ValueError, match=r"a\.py:1: write `from PACKAGE import MODULE`"):
        rewrite("import analysis.record\n", "a.py")
