"""Text from files, devices and names stays text wherever it is shown or stored: each poison in each sink."""

import csv
import dataclasses
import json
import os
import re
import zipfile
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from markdown_it import MarkdownIt
from PySide6.QtCore import QCoreApplication, QEvent, Qt
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QLabel, QMessageBox, QPushButton, QWidget

import app.qt
from analysis.campaign.campaign import Excluded, summarize
from analysis.campaign.series import SeriesKey
from analysis.motion.two_mass import TwoMassParameters
from app.cli import output
from app.presenters.base import Chip, Tone
from app.presenters.runs.state import Overlay, Trace
from app.qt.runs.preview import RunsPreview
from app.qt.widgets.inputs import ask
from app.qt.widgets.plots import PlotStack
from app.qt.widgets.text import button_text, label, markup, plain_text, set_tool_tip, show_chip
from app.reports.table.files import as_text, write_workbook
from app.reports.table.text import TableContent
from app.reports.test_report.blocks import Facts, Grid, Notice, Points, Report, Section, Text
from app.reports.test_report.render import render_pdf
from app.runs.exchange.content import ExportedRun, sample_columns
from app.runs.exchange.export_formats import FORMATS
from app.runs.reader import Run, open_run
from app.runs.simulated import write_simulated_run
from messages.control_characters import show_control_characters
from tests.app.runs.runs_kit import ANALYSIS
from tests.campaign_kit import FRICTION, run

POISONS = {
    "image": '<img src="/tmp/pipe"><a href="file:///etc/passwd">x</a><script>alert(1)</script>',
    "ampersand": "a&b &lt;b&gt; &copy; &#x41;",
    "escape sequence": "\x1b[31mred\x1b]0;title\x07\x9b2J\r over",
    "latex": r"\input{/etc/passwd} \write18{rm} $x$ % {",
    "typst": '#import "/etc/passwd" #eval("1") $x$ @label <label> *b* `c`',
    "formula": '=cmd|" /C calc"!A0',
    "plus": "+1+cmd",
    "at": "@SUM(A1)",
    "tab": "\t=1+1",
    "nul": "a\0b",
    "direction": "run\u202e5h.exe",
    "markdown": "![x](http://x) [y](javascript:z) | `c` <b> **d**",
    "rich": "[red]x[/red] [link=http://x]",
    "long": "x" * 10_000,
    "lines": "one\n% two\n\\input{x}\r\n=1",
}  # fmt: skip
UNSEEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
FORMULA = re.compile(r"\s*[=+\-@]")

poisons = pytest.mark.parametrize("poison", POISONS.values(), ids=POISONS)


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory) -> Run:
    path = tmp_path_factory.mktemp("foreign") / "run.h5"
    masses = {"table_mass_kg": 131.6, "plate_mass_kg": 22.4}
    parameters = TwoMassParameters.from_free_decay(
        **masses, period_s=0.32, damping_n1_per_s=0.12, friction_dynamic=0.1, pullback_m=0.012
    )
    write_simulated_run(path, parameters.simulate(2.0), parameters, rate_hz=200.0)
    return open_run(path, trusted=True)


def exported(run: Run, poison: str) -> ExportedRun:
    """The run as if all its texts were the poison."""
    metadata = run.metadata.replace(operator=poison, note=poison, title=poison)
    name = poison
    for mark in ("\0", "/", os.sep):
        name = name.replace(mark, "")
    named = run.path.with_name(name[:100] + ".h5")
    analysis = {**ANALYSIS, "series": poison, "run": poison, "warnings": [{"code": "x", "message": poison}]}
    foreign = dataclasses.replace(run, metadata=metadata, path=named)
    return ExportedRun(foreign, analysis, sample_columns(run))


def campaign(poison: str) -> TableContent:
    runs = [run("good.h5", SeriesKey("", poison, 0.012, 22.4, 131.6), {FRICTION: (0.2, 3e-5, 2e-4)})]
    summary = dataclasses.replace(summarize(runs), excluded=(Excluded(poison, poison),))
    return TableContent(summary, (), ((poison, poison),), None)


@poisons
def test_csv_holds_no_formula(whole_run, tmp_path, poison):
    FORMATS["csv"].write_coefficients([exported(whole_run, poison)], tmp_path / "a.csv")
    table = list(csv.reader(as_text(campaign(poison), "csv", 80).splitlines()))
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        texts = [cell for row in [*csv.reader(file), *table] for cell in row]
    assert not [text for text in texts if FORMULA.match(text) and not is_number(text)]


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


@poisons
def test_a_workbook_holds_no_formula(whole_run, tmp_path, poison):
    FORMATS["xlsx"].write_coefficients([exported(whole_run, poison)], tmp_path / "a.xlsx")
    write_workbook(campaign(poison), tmp_path / "b.xlsx")
    for name in ("a.xlsx", "b.xlsx"):
        book = openpyxl.load_workbook(tmp_path / name)
        assert not [cell for sheet in book for row in sheet for cell in row if cell.data_type == "f"]


@poisons
def test_latex_obeys_no_command(whole_run, tmp_path, poison):
    FORMATS["latex"].write_coefficients([exported(whole_run, poison)], tmp_path / "a.tex")
    texts = (tmp_path / "a.tex").read_text("utf-8"), as_text(campaign(poison), "latex", 80)
    for text in texts:
        code = "\n".join(line for line in text.split("\n") if not line.startswith("%"))
        assert not re.search(r"\\(input|write18)\b", code)


@poisons
def test_markdown_has_no_other_markup(poison):
    html = MarkdownIt("commonmark").enable("table").render(as_text(campaign(poison), "markdown", 80))
    known = {"table", "thead", "tbody", "tr", "th", "td", "p", "strong", "ul", "li", "h2"}
    assert set(re.findall(r"<(\w+)", html)) <= known


@poisons
def test_json_says_what_was_there(whole_run, tmp_path, poison, capsys):
    output.print_json({"note": poison})
    printed = capsys.readouterr().out
    assert json.loads(printed) == {"note": poison}
    assert not UNSEEN.search(printed)
    crate = tmp_path / "crate"
    one = exported(whole_run, poison)
    sound = ExportedRun(dataclasses.replace(one.run, path=whole_run.path), one.analysis, one.samples)
    FORMATS["ro-crate"].write_run(sound, crate)
    archived = json.loads(archive_text(crate, "ro-crate-metadata.json"))
    assert archived["@graph"]


def archive_text(path: Path, name: str) -> str:
    if path.is_dir():
        return (path / name).read_text("utf-8")
    with zipfile.ZipFile(path) as archive:
        (found,) = [entry for entry in archive.namelist() if entry.endswith(name)]
        return archive.read(found).decode()


@poisons
def test_a_terminal_is_not_steered(poison, capsys):
    output.print_line(poison)
    output.print_status(poison)
    output.print_fields([("note", poison)], 10)
    output.print_table(("note",), [(poison,)])
    output.print_document(as_text(campaign(poison), "text", 80), is_json=False)
    printed = "".join(capsys.readouterr())
    assert not UNSEEN.search(printed)
    assert printed.startswith(show_control_characters(poison) + "\n")


@pytest.mark.parametrize("poison", ["image", "typst", "nul", "direction", "long", "escape sequence"])
def test_a_report_is_typeset_as_text(poison):
    poison = POISONS[poison]
    blocks = [Text(poison), Points([poison]), Facts([(poison, poison)]), Notice(poison)]
    grid = Grid([poison], [[poison]])
    sections = [Section(poison, [*blocks, grid])]
    report = Report(poison, poison, [(poison, poison)], None, poison, "2026-11-24", poison, sections)
    assert render_pdf(report).startswith(b"%PDF")


@poisons
def test_widgets_show_text_as_it_is(qtbot, poison):
    seen = show_control_characters(poison)
    shown = label(poison)
    qtbot.addWidget(shown)
    assert shown.textFormat() is Qt.TextFormat.PlainText
    assert QLabel.text(shown) == seen
    show_chip(shown, Chip(poison, Tone.BAD, poison))
    assert shown.textFormat() is Qt.TextFormat.PlainText
    set_tool_tip(shown, poison)
    assert as_html(shown.toolTip()) == folded(seen)
    assert folded(plain_text(f"f_d of {poison}")) == folded(f"f_d of {seen}")
    assert as_html(markup(f"f<sub>d</sub> {poison}")) == folded(f"fd {seen}")
    button = QPushButton(button_text(poison))
    qtbot.addWidget(button)
    assert button.shortcut().isEmpty()


@pytest.fixture
def stack(theme):
    made = PlotStack(theme, (("", "text"),))
    yield made
    delete(made)


@pytest.fixture
def preview(theme):
    made = RunsPreview(theme)
    yield made
    delete(made)


def delete(widget):
    """Delete a widget at once, and not where Python happens to collect it, in the midst of an event."""
    widget.deleteLater()
    QCoreApplication.sendPostedEvents(widget, QEvent.Type.DeferredDelete)


@poisons
def test_plots_show_text_as_it_is(stack, poison):
    """Titles, readout and the title of an axis: what pyqtgraph takes for HTML."""
    seen = folded(show_control_characters(poison))
    (plot,) = stack.plots
    stack.set_title(0, poison)
    stack.set_readout(0, poison)
    stack.set_time_title(poison)
    stack.restyle()
    for item in (plot.title, plot.readout, plot.bottom):
        shown = item.labelString() if item is plot.bottom else item.text
        assert as_html(shown) == seen


@poisons
def test_the_legend_of_runs_shows_text_as_it_is(preview, poison):
    seen, line = folded(show_control_characters(poison)), np.zeros(3)
    trace = Trace(poison, np.arange(3.0), line, line)
    preview.show_overlay(Overlay((trace, trace)))
    assert as_html(QLabel.text(preview._names)).count(seen) == 2
    preview.show_overlay(Overlay((trace,)))
    assert preview._names.textFormat() is Qt.TextFormat.PlainText
    assert folded(QLabel.text(preview._names)) == seen


def as_html(text: str) -> str:
    """What Qt shows of a text that it may take for HTML; it loads no file for it."""
    if "<" not in text:
        return folded(text)

    class Document(QTextDocument):
        def loadResource(self, kind, url):  # noqa: N802
            raise AssertionError(f"{url} is loaded")

    document = Document()
    document.setHtml(text)
    return folded(document.toPlainText())


def folded(text: str) -> str:
    return " ".join(text.split())


def test_a_question_is_plain_text(qtbot):
    parent = QWidget()
    qtbot.addWidget(parent)
    ask(parent, POISONS["image"], POISONS["image"], "Delete", lambda: None)
    (box,) = parent.findChildren(QMessageBox)
    assert box.textFormat() is Qt.TextFormat.PlainText
    box.close()


def test_tool_tips_are_set_at_one_place():
    """Qt takes a tool tip for HTML where it looks like that."""
    sources = Path(app.qt.__file__).parent.rglob("*.py")
    direct = [path.name for path in sources if ".setToolTip(" in path.read_text("utf-8")]
    assert direct == ["text.py"]
    sources = Path(app.qt.__file__).parent.rglob("*.py")
    made = re.compile(r"\bQLabel\(|class \w+\(QLabel\)")
    assert [path.name for path in sources if made.search(path.read_text("utf-8"))] == ["text.py"]
