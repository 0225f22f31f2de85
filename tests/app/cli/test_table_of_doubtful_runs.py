"""Runs that do not belong together or rest on old calibrations, made as a user would make them."""

import re

import pytest

from config.files import config_directory


def test_runs_of_two_stands_and_expired_calibrations_are_said(recorded, slipstand):
    said = slipstand("table", recorded, "--json")
    warnings = [(one["code"], one["message"]) for one in said.json["warnings"]]
    expired = [message for code, message in warnings if code == "calibration-expired"]
    (stands,) = [message for code, message in warnings if code == "different-stands"]

    assert said.code == 0
    assert "'Stand B'" in stands
    assert "Give the runs of one stand at a time" in stands
    assert [re.search(r"gauge \d", message)[0] for message in expired] == ["gauge 1", "gauge 2"]
    assert all("1SSM0" in message and "1FFM0" not in message for message in expired)
    assert all("until 2025-01-12" in message and "slipstand calibrate" in message for message in expired)
    assert "several-calibrations" in dict(warnings)


def test_report_of_a_run_says_at_its_top_that_calibrations_had_expired(recorded, slipstand, sections):
    (run,) = recorded.glob("b/*1SSM0*.h5")
    assert slipstand("report", run, "-o", recorded / "run.pdf").code == 0
    result = sections()["Result"]

    assert [block.text.partition(" was ")[0] for block in result[1:3]] == [
        "the calibration of gauge 1 (table)",
        "the calibration of gauge 2 (relative)",
    ]


def test_report_of_a_campaign_names_both_stands_and_calibrations(recorded, slipstand, sections):
    assert slipstand("report", recorded, "-o", recorded / "campaign.pdf").code == 0
    found = sections()

    assert len(found["Stands"]) == len(found["Gauges and calibration"]) == 2
    assert sum("was valid until 2025-01-12" in text for text in found["Warnings"][0].texts) == 2


@pytest.fixture
def recorded(slipstand, tmp_path, monkeypatch):
    """A folder with a run of the usual stand, and one of another whose calibrations had expired."""
    other = tmp_path / "settings"
    other.mkdir()
    stand, gauges = ((config_directory() / name).read_text("utf-8") for name in ("stand.toml", "gauges.toml"))
    renamed = re.sub(r"^name = .*$", 'name = "Stand B"', stand, count=1, flags=re.MULTILINE)
    (other / "stand.toml").write_text(renamed, "utf-8")
    ended = gauges.replace("date = 2026-01-12", "date = 2024-01-12\nvalid_until = 2025-01-12")
    (other / "gauges.toml").write_text(ended, "utf-8")
    runs = tmp_path / "runs"
    demo = ("demo", "--campaign", "--repeats", "1")
    assert slipstand(*demo, "--series", "1FFM0", "--directory", runs / "a").code == 0
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(other))
    assert slipstand(*demo, "--series", "1SSM0", "--directory", runs / "b").code == 0
    monkeypatch.delenv("SLIPSTAND_CONFIG")
    return runs


@pytest.fixture
def sections(monkeypatch):
    """Blocks by section of the report that was written last."""
    from app.reports.test_report import render

    written, typeset = [], render.render_pdf
    monkeypatch.setattr(render, "render_pdf", lambda report: written.append(report) or typeset(report))
    return lambda: {section.title: section.blocks for section in written[-1].sections}
