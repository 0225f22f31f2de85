"""A crate as the reference library of RO-Crate reads it."""

import hashlib
import json
from zipfile import ZipFile

import pytest

rocrate = pytest.importorskip("rocrate.rocrate")


def test_the_peer_finds_runs_results_and_how_they_were_obtained(slipstand, tmp_path) -> None:
    for series in ("1FFM0", "2SSM1"):
        slipstand("simulate", "--series", series, "-o", tmp_path / f"{series}.h5")
    paths = sorted(tmp_path.glob("*.h5"))
    outcome = slipstand("export", *paths, "--format", "ro-crate", "-o", tmp_path / "crate.zip")
    assert outcome.code == 0, outcome.err
    crate = rocrate.ROCrate(tmp_path / "crate.zip")
    assert crate.name == "Pullback tests on a shaking stand, 2 runs of 1FFM0, 2SSM1"
    files = {entity.id: entity for entity in crate.data_entities}
    assert set(files) == {
        "runs/1FFM0.h5", "runs/2SSM1.h5", "results/1FFM0.json", "results/2SSM1.json", "coefficients.csv",
    }  # fmt: skip
    with ZipFile(tmp_path / "crate.zip") as archive:
        for name, entity in files.items():
            assert hashlib.sha256(archive.read(name)).hexdigest() == entity["sha256"]
        assert archive.read("runs/1FFM0.h5") == paths[0].read_bytes()
        result = json.loads(archive.read("results/1FFM0.json"))
    assert result["results"]["friction_dynamic"]["value"] == pytest.approx(0.1, rel=1e-3)
    actions = [entity for entity in crate.contextual_entities if entity.type == "CreateAction"]
    made = {(one["object"].id, one["result"].id, one["instrument"]["name"]) for one in actions}
    assert made == {
        ("runs/1FFM0.h5", "results/1FFM0.json", "Slipstand"),
        ("runs/2SSM1.h5", "results/2SSM1.json", "Slipstand"),
    }
    series = {value["name"]: value["value"] for value in files["runs/2SSM1.h5"]["variableMeasured"]}
    assert series["series"] == "2SSM1"
