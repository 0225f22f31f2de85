"""What packages are made of agrees with the program; nothing is built here."""

import re
import tomllib
from pathlib import Path
from xml.etree import ElementTree

from app.version import __version__
from tools.packages import recipes

ROOT = Path(__file__).resolve().parents[2]
LINUX = ROOT / "packaging" / "linux"


def test_recipes_are_filled_in(tmp_path):
    written = recipes.write_recipes("https://example.org/files", "a" * 64, "b" * 64, tmp_path)
    texts = {path.name: path.read_text("utf-8") for path in written}
    assert len(texts) == 5
    assert all(__version__ in text for text in texts.values())
    assert not [name for name, text in texts.items() if re.search("@[A-Z_0-9]+@", text)]
    assert "B" * 64 in texts["Slipstand.Slipstand.installer.yaml"]
    assert "a" * 64 in texts["slipstand.rb"]
    assert "a" * 64 in texts["recipe.yaml"]


def test_the_recipe_of_conda_requires_what_the_package_requires():
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["dependencies"]
    names = {re.split(r"[<>=]", line)[0].strip().lower() for line in stated}
    required = {line.split()[1] for line in recipes.conda_requirements()}
    renamed = {"pyside6-essentials": "pyside6", "matplotlib": "matplotlib-base"}
    assert required == {renamed.get(name, name) for name in names}


def test_the_menu_opens_the_type_of_run_files():
    entry = (LINUX / "slipstand.desktop").read_text("utf-8")
    types = ElementTree.parse(LINUX / "slipstand.mime.xml").getroot()
    (declared,) = types.findall("{*}mime-type")
    assert f"MimeType={declared.get('type')};" in entry
    offered = ElementTree.parse(LINUX / "slipstand.metainfo.xml").findtext("provides/mediatype")
    assert offered == declared.get("type")


def test_a_run_file_has_the_word_by_which_it_is_told_from_other_hdf5(slipstand, tmp_path):
    slipstand("simulate", "--series", "1FFM0", "-o", tmp_path / "run.h5")
    start = (tmp_path / "run.h5").read_bytes()[:4096]
    (outer,) = ElementTree.parse(LINUX / "slipstand.mime.xml").findall("{*}mime-type/{*}magic/{*}match")
    (inner,) = outer
    assert outer.get("value", "").encode().decode("unicode_escape").encode("latin-1") == start[:8]
    assert inner.get("value", "").encode() in start[64:]
