"""The head of a report: number, laboratory, customer and method, and pages that bear the number."""

import datetime

import msgspec
import pytest

from app.reports.test_report.blocks import Points, Report, Section
from app.reports.test_report.head import METHOD, LogoError, ReportHead, read_head, read_logo
from app.reports.test_report.render import render_pdf, typeset_report

DAY = datetime.date(2026, 11, 21)
SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 4"><rect width="10" height="4"/></svg>'


@pytest.fixture
def settings(tmp_path, monkeypatch):
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path))
    (tmp_path / "logo.svg").write_text(SVG)
    (tmp_path / "settings.toml").write_text(
        'laboratory = "Institute of Mechanics"\nlaboratory_address = "1 Street\\n100174 Tashkent"\n'
        'laboratory_logo = "logo.svg"\n'
    )
    return tmp_path


def pages(number, logo=None):
    many = Section("Part", [Points([f"point {place}" for place in range(120)])])
    report = Report("Title", "Subtitle", [], logo, number, "2026-11-21", "Slipstand", [many])
    return typeset_report(report, format="png", ppi=40.0)


def test_the_head_is_that_of_the_settings(settings):
    head = read_head(DAY)
    assert (head.laboratory, head.address) == ("Institute of Mechanics", "1 Street\n100174 Tashkent")
    assert (head.customer, head.method) == ("", METHOD)
    assert bytes(head.logo.data) == SVG.encode()


def test_a_number_is_made_of_date_and_inputs_unless_it_is_given():
    assert ReportHead(date=DAY).numbered("0123456789").number == "20261121-01234567"
    assert ReportHead(date=DAY, number="B2-17").numbered("0123456789").number == "B2-17"


def test_each_page_bears_the_number():
    first, other = pages("A-1"), pages("B-2")
    assert len(first) == len(other) > 2
    assert all(one != two for one, two in zip(first, other, strict=True))


def test_a_logo_is_on_the_first_page_alone(settings):
    plain, with_logo = pages("A-1"), pages("A-1", read_logo("logo.svg"))
    assert plain[0] != with_logo[0]
    assert len(plain) == len(with_logo)


@pytest.mark.parametrize(
    ("name", "content", "fault"),
    [
        ("absent.png", None, "cannot be read"),
        ("logo.gif", b"GIF89a", "no picture that a report can print"),
        ("damaged.png", b"\x89PNG\r\n\x1a\nrubbish", "is damaged or larger than 2 MB"),
        ("damaged.svg", b"<svg", "is damaged or larger than 2 MB"),
    ],
)
def test_a_logo_that_cannot_be_printed_is_named(settings, name, content, fault):
    if content is not None:
        (settings / name).write_bytes(content)
    with pytest.raises(LogoError, match=fault) as raised:
        read_logo(name)
    assert str(settings / name) in str(raised.value)


def test_options_of_the_command_stand_before_the_settings(slipstand, settings, short_runs, monkeypatch):
    made = []
    monkeypatch.setattr("app.cli.report.write_report", lambda report, *_, **__: made.append(report))
    words = ("--customer", "Works", "--number", "B2-17", "--method", "GOST 1", "--date", "2026-11-21")
    said = slipstand("report", short_runs[0], "-o", settings / "report.pdf", *words, "--json").json
    assert said["number"] == "B2-17"
    (report,) = made
    assert dict(report.head) == {
        "report number": "B2-17",
        "date of issue": "2026-11-21",
        "laboratory": "Institute of Mechanics\n1 Street\n100174 Tashkent",
        "customer": "Works",
        "method": "GOST 1",
    }
    assert render_pdf(msgspec.structs.replace(report, sections=[])).startswith(b"%PDF")
    for word in words[:6]:
        assert word in said["origin"]["reproduce"]


def test_a_logo_that_is_missing_is_one_line(slipstand, settings, short_runs):
    (settings / "logo.svg").unlink()
    said = slipstand("report", short_runs[0], "-o", settings / "report.pdf")
    assert said.code == 1
    assert said.err.startswith("error: laboratory_logo ")
    assert said.err.count("\n") == 1
