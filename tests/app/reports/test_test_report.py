"""The report: complete, user text taken literally, the same bytes each time."""

import datetime
import hashlib
import re
from itertools import pairwise
from types import SimpleNamespace

import msgspec
import pytest
from reports_kit import write_run

from analysis.formatting import typeset_sentence
from app.reports.table.text import TableContent
from app.reports.test_report.blocks import (
    Conclusion,
    Drawings,
    Facts,
    Grid,
    Notice,
    Points,
    Report,
    Section,
    Symbol,
    Text,
)
from app.reports.test_report.build import build_report
from app.reports.test_report.head import ReportHead
from app.reports.test_report.render import printable, render_pdf, typeset_report, write_report
from app.reports.test_report.shared import SIGNATURES
from app.runs.analyze import repeat_saved_analysis
from app.runs.campaign.collect import CollectOptions, collect_runs
from app.runs.campaign.origin import CampaignOrigin
from app.runs.errors import RunExistsError
from app.version import __version__, commit

HEAD = ReportHead(date=datetime.date(2026, 11, 21), laboratory="Laboratory of Mechanics")
NOTE = '#panic("no") *bold* _it_ $x$ <label> @ref \\ // `raw` [a](b) 1. = Head'


def small(*blocks):
    return Report(
        "Title", "Subtitle", [], None, "R-1", "2026-11-21", "Slipstand", [Section("Part", list(blocks))]
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    write_run(folder / "a.h5", seed=1, facts={"note": NOTE, "operator": "A. Operator"})
    write_run(folder / "b.h5", seed=2)
    write_run(folder / "c.h5", "3SSM0", seed=3, friction_dynamic=0.8)
    return folder


def made(*paths, excluded=None):
    gathered = collect_runs(paths, CollectOptions(excluded=excluded or {}))
    return build_report(gathered, TableContent.of_runs(gathered, "slipstand report RUNS"), HEAD)


@pytest.fixture(scope="module")
def of_run(folder):
    return made(folder / "a.h5")


@pytest.fixture(scope="module")
def of_campaign(folder):
    return made(folder, excluded={str(folder / "b.h5"): "gauge 2 was touched"})


def render_pages(report, dots_per_inch):
    return typeset_report(report, format="png", ppi=dots_per_inch)


def part(report, title):
    (found,) = [section.blocks for section in report.sections if section.title == title]
    return found


def text_of(report):
    return msgspec.json.encode(report.sections).decode()


def test_report_of_a_run_that_does_not_count_says_so_first(folder):
    report = made(folder / "b.h5", excluded={str(folder / "b.h5"): "gauge 2 was touched"})
    _, notice, *_ = report.sections[0].blocks

    assert isinstance(notice, Notice)
    assert "left out" in notice.text
    assert "gauge 2 was touched" in notice.text
    assert render_pdf(report).startswith(b"%PDF")


def test_report_of_a_run_says_what_was_found(of_run, folder):
    found = repeat_saved_analysis(folder / "a.h5").identification
    (_, verdict, _) = part(of_run, "Result")
    (results, _, tried) = part(of_run, "Results")
    rows = {row[0]: row[2:4] for row in results.rows}

    friction = found.results["friction_dynamic"]
    assert verdict.symbol == Symbol("f_d")
    assert verdict.value == f"{friction.value:.5f}\u00a0±\u00a0{friction.standard_uncertainty:.5f}"
    assert verdict.tone == "ok"
    assert float(rows["period"][0]) == pytest.approx(found.results["period_s"].value * 1e3, abs=1e-3)
    assert float(rows["period"][1]) == pytest.approx(
        found.results["period_s"].standard_uncertainty * 1e3, rel=0.05
    )
    assert [row[0] for row in tried.rows] == [law.name for law in found.model.tried]
    assert of_run.subtitle == "1FFM0, a.h5"


def test_reports_state_expanded_uncertainties_with_factor_and_coverage(of_run, of_campaign, folder):
    found = repeat_saved_analysis(folder / "a.h5").identification.results
    (_, _, meaning) = part(of_run, "Result")
    (results, _, _) = part(of_run, "Results")
    stated = re.fullmatch(r".* U = (\S+) \(k = 2, coverage of about 95 %\).*", meaning.text)
    friction = found["friction_dynamic"]
    assert float(stated[1]) == pytest.approx(2.0 * friction.standard_uncertainty, rel=0.05)
    column = results.header.index("U (k = 2)")
    period = next(row for row in results.rows if row[0] == "period")
    assert float(period[column]) == pytest.approx(2e3 * found["period_s"].standard_uncertainty, rel=0.05)
    (text,) = [block.text for block in part(of_run, "Procedure") if "k = 2" in getattr(block, "text", "")]
    assert "a coverage of about 95 % where the distribution is normal" in text

    (budget,) = [
        block
        for section in of_campaign.sections
        for block in section.blocks
        if isinstance(block, Grid) and "U (k = 2)" in block.header
    ]
    (row,) = [row for row in budget.rows if row[0] == "1FFM0"]
    pooled = collect_runs([folder / "a.h5"]).campaign().rows[0].quantities["friction_dynamic"].quantity
    assert float(row[budget.header.index("U (k = 2)")]) == pytest.approx(
        2.0 * pooled.standard_uncertainty, rel=0.05
    )


def test_reports_of_simulated_runs_say_so_first_and_name_their_origin(of_run, of_campaign):
    for report in (of_run, of_campaign):
        first = report.sections[0].blocks[0]
        assert isinstance(first, Notice)
        assert first.text.startswith("SIMULATED: ")
        assert report.mark == "SIMULATED"
    (facts,) = part(of_run, "Origin")
    rows = dict(facts.rows)
    assert rows["program"] == f"slipstand {__version__}" + (f" ({commit()})" if commit() else "")
    assert rows["gauge 1"].startswith("SIM-1 of 2026-01-12 (")
    assert rows["this report"] == "slipstand report RUNS"
    (points,) = part(of_campaign, "Origin")
    assert points.texts[-1] == "Reproduce: slipstand report RUNS"
    assert any("m2 22.4 kg, g 9.81" in text for text in points.texts)


def test_report_of_a_run_says_whether_friction_depends_on_velocity(of_run):
    said = [block.text for section in of_run.sections for block in section.blocks if isinstance(block, Text)]

    assert any("per 100 mm/s of sliding velocity" in text for text in said)
    captions = [
        item.caption
        for section in of_run.sections
        for block in section.blocks
        if isinstance(block, Drawings)
        for item in block.items
    ]
    assert sum("from the plate alone" in caption for caption in captions) == 3


def test_report_holds_the_whole_budget_largest_first(of_run, folder):
    found = repeat_saved_analysis(folder / "a.h5").identification
    (grid,) = part(of_run, "Uncertainty budget")
    cells = {row[0]: row[2] for row in grid.rows if row[2]}
    *_, last, together = cells
    assert (last, together) == ("time base (not stated)", "together")
    assert cells.pop(last) == "not stated"
    shares = {source: float(cell.replace("−", "-")) for source, cell in cells.items()}

    *sources, total = shares.values()
    for line in found.budget:
        if line.contribution_to == "friction_dynamic" and str(line.source) != last:
            assert shares[str(line.source)] == pytest.approx(line.standard_uncertainty, rel=0.06), str(
                line.source
            )
    assert all(larger >= 0.99 * smaller for larger, smaller in pairwise(sources))
    assert total == pytest.approx(found.results["friction_dynamic"].standard_uncertainty, rel=0.05)
    assert {row[1] for row in grid.rows if row[0] == "noise"} == {"A"}


def test_report_bears_stand_gauges_fingerprints_and_places_to_sign(of_run, folder):
    said = text_of(of_run)

    for fact in ("A. Operator", "SIM-1", "SIM-2", "dial gauge 0.01 mm", "131.60", "2\u00a0nm per count"):
        assert fact in said, fact
    assert hashlib.sha256((folder / "a.h5").read_bytes()).hexdigest() in said
    assert re.search(r"table_displacement [0-9a-f]{8}", said)
    assert part(of_run, "Signatures")[-1].roles == ["Tested by", "Checked by", "Approved by"]
    assert of_run.software.startswith("Slipstand ")


def test_run_without_slip_says_so(folder):
    report = made(folder / "c.h5")
    (_, verdict) = part(report, "Result")

    assert (verdict.symbol, verdict.relation, verdict.tone) == (Symbol("f_s"), "≥", "warn")
    assert "did not slip" in verdict.text
    assert "no-slip" in part(report, "Warnings")[0].texts[0]
    assert render_pdf(report).startswith(b"%PDF")


def test_report_of_a_campaign_holds_table_effects_and_what_was_left_out(of_campaign, folder):
    (table,) = part(of_campaign, "Table of results")
    (runs,) = part(of_campaign, "Runs")
    (_, prints) = part(of_campaign, "Data")
    (repeats,) = part(of_campaign, "Repeatability")

    assert [row[0] for row in table.rows] == ["1FFM0", "3SSM0"]
    assert part(of_campaign, "Runs that do not count")[0].texts == ["b.h5: gauge 2 was touched"]
    assert Symbol("n_1") in repeats.header
    assert [(row[0], row[6]) for row in runs.rows] == [
        ("a.h5", "fits"),
        ("b.h5", "left out"),
        ("c.h5", "no law fitted"),
    ]
    assert [row[0] for row in prints.rows] == ["a.h5", "b.h5", "c.h5"]
    assert any(section.title.startswith("What f_d depends on") for section in of_campaign.sections)
    assert str(folder) not in text_of(of_campaign), "a report says nothing of the computer it was made on"


def test_the_mark_stands_on_each_page_and_tells_how_many_runs_are_simulated(of_campaign):
    marked = render_pages(of_campaign, 40.0)
    plain = render_pages(msgspec.structs.replace(of_campaign, mark=""), 40.0)
    assert len(marked) == len(plain) > 2
    assert all(one != other for one, other in zip(marked, plain, strict=True))

    def details(source):
        return SimpleNamespace(origin={"source": source})

    runs = {"a": details("simulated"), "b": details("real")}
    assert CampaignOrigin(runs=runs).mark == "SIMULATED: 1 of 2 runs"
    assert CampaignOrigin(runs={"b": runs["b"]}).mark == ""


@pytest.mark.parametrize("origin", [5, 90])
@pytest.mark.parametrize("kind", [Points, Facts])
def test_signatures_share_their_page_with_the_end_of_what_precedes_them(kind, origin):
    def last_page(lines, end):
        texts = [*(f"line {number}" for number in range(origin)), end]
        listed = Points(texts) if kind is Points else Facts([("fact", text) for text in texts])
        report = small(Text("\n".join(["a"] * lines)))
        sections = [*report.sections, Section("Origin", [listed]), SIGNATURES]
        pages = render_pages(msgspec.structs.replace(report, sections=sections), 20.0)
        return pages[-1] if isinstance(pages, list) else pages

    for lines in range(1, 60, 5):
        assert last_page(lines, "mmmm") != last_page(lines, "....."), lines


def test_a_percentage_is_not_parted_at_the_end_of_a_line():
    assert printable("5 % of it, 50 %") == "5\u00a0% of it, 50\u00a0%"


def test_landscape_pages_of_a_campaign_follow_each_other(of_campaign):
    """Each change of the orientation begins a page: small campaigns had two nearly empty ones."""
    wide = [section.title for section in of_campaign.sections if section.wide]
    first = next(place for place, section in enumerate(of_campaign.sections) if section.wide)
    assert [section.title for section in of_campaign.sections[first:][: len(wide)]] == wide
    assert wide[-1] == "Runs"


def test_bounds_of_static_friction_are_left_out_where_it_is_known(tmp_path):
    write_run(tmp_path / "s.h5", friction_static=0.2)
    (results, _, tried) = part(made(tmp_path / "s.h5"), "Results")
    named = [row[0] for row in results.rows]
    assert "static friction" in named
    assert not [name for name in named if name.startswith("static friction, at")]
    assert "has no uncertainty" in tried.note
    (friction,) = [row[2] for row in results.rows if row[0] == "dynamic friction"]
    assert {len(row[1]) for row in tried.rows} == {len(friction)}


def test_notes_below_a_table_are_sentences(of_campaign):
    grids = [block for section in of_campaign.sections for block in section.blocks if isinstance(block, Grid)]
    assert [grid.note for grid in grids if grid.note and not grid.note.endswith(".")] == []


def test_numbers_in_sentences_have_true_minus_signs_and_names_their_hyphens():
    said = typeset_sentence("-0.1 % (95 %: -0.3 % to +0.1 %) in run-1.h5, 2026-11-21, p < 1e-3")

    assert said == "−0.1 % (95 %: −0.3 % to +0.1 %) in run-1.h5, 2026-11-21, p < 1e-3"


def test_the_same_runs_give_the_same_bytes_apart_from_the_date(folder, of_campaign):
    first, again = made(folder / "c.h5"), made(folder / "c.h5")
    other_day = msgspec.structs.replace(of_campaign, date="2027-01-01")

    assert render_pdf(first) == render_pdf(again)
    pdf = render_pdf(of_campaign)
    assert pdf != render_pdf(other_day)
    assert b"D:20261121" in pdf


def test_reports_are_pdf_a(of_run):
    pdf = render_pdf(of_run)

    assert b"<pdfaid:part>2</pdfaid:part>" in pdf
    assert b"<pdfaid:conformance>A</pdfaid:conformance>" in pdf


@pytest.mark.parametrize(
    "text", [NOTE, '#include "/etc/passwd"', "\\u{41} #sys.version", "{}[]()#$%^&*\n\n= no head"]
)
def test_what_an_operator_wrote_is_no_command(text):
    plain = small(Text("x" * 5))
    report = small(Facts([("note", text)]), Points([text]), Text(text), Grid(["a"], [[text]], note=text))

    assert render_pages(report, 20.0)
    written = msgspec.structs.replace(report, title=text, subtitle=text, head=[("laboratory", text)])
    assert render_pages(written, 20.0)
    assert render_pages(plain, 20.0) != render_pages(small(Text(text)), 20.0)


def test_stars_are_printed_and_not_taken_for_bold():
    bold, plain = render_pages(small(Text("*a*")), 40.0), render_pages(small(Text("a")), 40.0)
    same = render_pages(small(Text("*a*")), 40.0)

    assert bold == same
    assert bold != plain


def test_signs_that_the_typeface_lacks_are_told_by_their_number():
    assert printable("Проба 摩擦 \U0001f600") == "Проба [U+6469][U+64E6] [U+1F600]"
    assert printable("a\r\nb\tc\x07") == "a\nb c[U+0007]"
    assert render_pdf(small(Text("摩擦 \U0001f600 \x07"))).startswith(b"%PDF")


def test_words_without_end_break():
    assert max(map(len, printable("x" * 500).split("\u200b"))) == 48
    assert printable("x" * 48) == "x" * 48


def test_verdicts_of_every_tone_can_be_printed():
    blocks = [Conclusion(Symbol("f_d"), "0.1", "said", tone) for tone in ("ok", "warn", "bad")]
    assert render_pages(small(*blocks), 20.0)


def test_nothing_is_overwritten_without_being_asked(tmp_path):
    target = tmp_path / "report.pdf"
    target.write_text("mine", "utf-8")

    with pytest.raises(RunExistsError):
        write_report(small(Text("a")), target)
    assert target.read_text("utf-8") == "mine"
    write_report(small(Text("a")), target, replace=True)
    assert target.read_bytes().startswith(b"%PDF")
    assert [file.name for file in tmp_path.iterdir()] == ["report.pdf"]
