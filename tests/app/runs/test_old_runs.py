"""Run files of earlier versions open and analyse to the same digits.

`tests/golden/old_runs` holds 20 run files written at commit 2538d8f: imported, simulated, and recorded over
serial protocols, two of them with a saved analysis. `expected.json.gz` is what that commit printed, with
paths cut to file names: `slipstand analyze RUNS --json`, the same with `--kind one-mass` for the run of one
gauge, and `slipstand runs --json`.
"""

import gzip
import json
import shutil
import sys
from math import hypot
from pathlib import Path
from typing import Any

import pytest

from app.__main__ import main

OLD_RUNS = Path(__file__).resolve().parents[2] / "golden" / "old_runs"
RELATIVE_DIFFERENCE = 1e-9
"""Between processors and builds of LAPACK; the same machine gives the same bits."""
LINE_DIFFERENCE = 1e-8
"""Of the result's standard uncertainty, by which a line of its budget may differ."""
ROUNDING = 1e-14
"""By which a line of a budget may differ where it is the rounding of a sum, as of a run without noise."""
DRAWN = {"slip_end_uncertainty_s": (1e-3, 1e-8)}
"""Relative and absolute differences of what is counted over drawn parameters: rounding moves single draws."""

_UNSTATED = ("gain-not-stated", "clock-not-timed")
_LATER_WARNINGS = {
    "negative-3FFM3.h5": (),  # simulated: its clock is exact, and its gains are stated
    "simulated-2FFM3.h5": (),
    "no-slip-1FFM0.h5": ("clock-not-timed",),  # without f_d, which depends on the gains
    "tilt-static-3FFM1.h5": ("tilt-beyond-level", *_UNSTATED),  # of 3 mrad
}
"""Codes that the earlier version did not give, by run; `_UNSTATED` for the others."""
_OPEN_STATIC_COUNTED_TWICE = "negative-3FFM3.h5"
"""Run without noise in whose end of slip the earlier version drew an open f_s besides all allowed ones."""
_CLOCK = "time base (not stated)"
_WITH_TIME = ("period_s", "stiffness_n_per_m", "friction_dynamic")


@pytest.fixture(scope="module")
def expected() -> Any:
    return json.loads(gzip.decompress((OLD_RUNS / "expected.json.gz").read_bytes()))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    unpacked = tmp_path_factory.mktemp("old")
    for packed in OLD_RUNS.glob("*.h5.gz"):
        with gzip.open(packed) as source, (unpacked / packed.stem).open("wb") as target:
            shutil.copyfileobj(source, target)
    return unpacked


def printed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *arguments: object
) -> list[Any]:
    """JSON that a command prints, with paths cut to file names."""
    monkeypatch.setattr(sys, "argv", ["slipstand", *map(str, arguments), "--json"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code in (0, None)
    documents: list[Any] = json.loads(capsys.readouterr().out)
    for document in documents:
        key = "run" if "run" in document else "path"
        document[key] = Path(document[key]).name
    return documents


def assert_same(
    now: Any, then: Any, where: str, relative: float = RELATIVE_DIFFERENCE, absolute: float = ROUNDING
) -> None:
    """Compare everything that the earlier version printed; new keys may have come, sentences may differ."""
    if isinstance(then, dict):
        for key, value in then.items():
            if key not in ("message", "source"):
                assert key in now, f"{where}.{key}"
                assert_same(now[key], value, f"{where}.{key}", *DRAWN.get(key, ()))
    elif isinstance(then, list):
        assert len(now) == len(then), where
        for number, (one, other) in enumerate(zip(now, then, strict=True)):
            assert_same(one, other, f"{where}[{number}]")
    elif isinstance(then, float):
        assert now == pytest.approx(then, rel=relative, abs=absolute, nan_ok=True), where
    else:
        assert now == then, where


def _of_old_results(now: Any, then: Any) -> list[Any]:
    """Budget of the quantities that the earlier version knew, without the clock that it said nothing of."""
    known = {line["contribution_to"] for line in then["budget"]}
    lines = [line for line in now["budget"] if line["contribution_to"] in known]
    return [line for line in lines if line["source"] != _CLOCK]


def take_budget(now: Any, then: Any) -> None:
    """Compare budgets on the scale of the result's standard uncertainty; `now` gets the lines of `then`.

    Lines far below it are differences of nearly equal numbers, whose digits the order of a summation moves.
    """
    for one, other in zip(now["budget"], then["budget"], strict=True):
        result = then["results"][other["contribution_to"]]
        scale = result["standard_uncertainty"] or abs(result["value"])
        place = f"{then['run']}: {other['contribution_to']}, {other['source']}"
        if other["standard_uncertainty"] is None:
            assert one["standard_uncertainty"] is None, place
            continue
        off = abs(one["standard_uncertainty"] - other["standard_uncertainty"])
        assert off <= max(LINE_DIFFERENCE * scale, ROUNDING), place
        one |= {key: value for key, value in other.items() if isinstance(value, float)}


_BREAKAWAY = "plate_acceleration_max_m_per_s2"


def assert_wider_breakaway(now: Any, then: Any) -> None:
    """Compare the plate's largest acceleration where the law ties f_s to f_d; `now` loses its uncertainty.

    The earlier version left out that f_s may exceed f_d by what the readings do not show.
    """
    if (then["model"] or {}).get("name") not in ("coulomb", "coulomb+tilt"):
        return
    wider, narrow = (document["results"][_BREAKAWAY] for document in (now, then))
    least = 1.0 - RELATIVE_DIFFERENCE
    assert wider["standard_uncertainty"] >= least * narrow["standard_uncertainty"], then["run"]
    now["results"][_BREAKAWAY] = {**narrow, "value": wider["value"]}
    for one, other in zip(now["budget"], then["budget"], strict=True):
        if (one["contribution_to"], one["source"]) == (_BREAKAWAY, "noise"):
            assert one["standard_uncertainty"] >= least * other["standard_uncertainty"] - ROUNDING, then[
                "run"
            ]
            one["standard_uncertainty"] = other["standard_uncertainty"]


def assert_same_codes(now: Any, then: Any, later: tuple[str, ...], gone: tuple[str, ...] = ()) -> None:
    """Compare warnings by code, and that a clock that was not timed is in the budget; `now` loses both."""
    codes = [warning["code"] for warning in then["warnings"] if warning["code"] not in gone]
    assert sorted(warning["code"] for warning in now["warnings"]) == sorted([*codes, *later]), then["run"]
    clock = {line["contribution_to"] for line in now["budget"] if line["source"] == _CLOCK}
    expected = set(_WITH_TIME).intersection(now["results"]) if "clock-not-timed" in later else set()
    assert clock.intersection(_WITH_TIME) == expected, then["run"]
    now["warnings"] = then["warnings"]


def test_old_runs_analyse_to_the_same_digits(folder, expected, capsys, monkeypatch):
    """Those that a friction law on an ideal stand explains; to others effects of the stand may be added."""
    *two_gauges, _ = expected["analyze"]
    two_gauges = [then for then in two_gauges if (then["model"] or {}).get("adequate", True)]
    runs = [folder / analysis["run"] for analysis in two_gauges]
    now = printed(capsys, monkeypatch, "analyze", *runs)
    for one, other in zip(now, two_gauges, strict=True):
        assert_same_codes(one, other, _LATER_WARNINGS.get(other["run"], _UNSTATED))
        one["budget"] = _of_old_results(one, other)
        assert_wider_breakaway(one, other)
        take_budget(one, other)
        if other["run"] == _OPEN_STATIC_COUNTED_TWICE:
            uncertainty_s = one["events"].pop("slip_end_uncertainty_s")
            assert 0.0 < uncertainty_s <= other["events"].pop("slip_end_uncertainty_s")
    assert_same(now, two_gauges, "analyze")


def test_an_old_run_of_one_gauge_keeps_its_digits_and_has_what_its_halves_differ_by_besides(
    folder, expected, capsys, monkeypatch
):
    """No model explains it: its plate slips, which was called a second mode."""
    then = expected["analyze"][-1]
    (now,) = printed(capsys, monkeypatch, "analyze", folder / then["run"], "--kind", "one-mass")
    assert_same_codes(now, then, ("clock-not-timed",), gone=("second-mode",))
    lines = _of_old_results(now, then)
    model = {
        line["contribution_to"]: line["standard_uncertainty"] for line in lines if line["source"] == "model"
    }
    for name, spread in model.items():
        found, before = now["results"][name], then["results"][name]
        assert found["standard_uncertainty"] == pytest.approx(hypot(before["standard_uncertainty"], spread))
        before |= {key: found[key] for key in ("standard_uncertainty", "interval_95")}
    assert model.keys() == then["results"].keys() - {"coulomb_significant", "log_decrement_classical"}
    now["budget"] = [line for line in lines if line["source"] != "model"]
    assert_same(now, then, "analyze")


def test_budgets_of_old_runs_keep_their_sources(folder, expected, capsys, monkeypatch):
    then = expected["analyze"][0]
    (now,) = printed(capsys, monkeypatch, "analyze", folder / then["run"])
    assert [line["source"] for line in _of_old_results(now, then)] == [
        line["source"] for line in then["budget"]
    ]


def test_old_runs_are_listed_with_the_same_facts(folder, expected, capsys, monkeypatch):
    now = {run["path"]: run for run in printed(capsys, monkeypatch, "runs", folder)}
    then = {run["path"]: run for run in expected["runs"]}
    assert_same(now, then, "runs")


@pytest.mark.parametrize(
    ("name", "friction"), [("gsv", 0.12), ("csv", 0.12), ("tilt", 0.12), ("slipstand-binary", 0.1)]
)
def test_old_runs_that_end_with_the_plate_put_back_give_the_friction_before(
    folder, capsys, monkeypatch, name, friction
):
    """Stands simulated with this f_d; an operator puts the plate back after 6 s, which was fitted too."""
    (now,) = printed(capsys, monkeypatch, "analyze", folder / f"recorded-{name}.h5")
    found = now["results"]["friction_dynamic"]
    assert now["model"]["adequate"]
    assert abs(found["value"] - friction) < 4.0 * found["standard_uncertainty"]
    assert "moved-again" in [warning["code"] for warning in now["warnings"]]
