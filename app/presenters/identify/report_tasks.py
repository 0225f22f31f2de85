"""Tasks of the report of a run, executed in a worker process. They load matplotlib and typst."""

import datetime
from pathlib import Path

from app.reports.test_report.blocks import Report
from app.reports.test_report.build import build_run_report
from app.reports.test_report.head import read_head
from app.reports.test_report.render import render_pages, write_report

_PRINTED_DPI = 300.0


def write_run_report(path: str, target: str) -> str:
    """Write the report of a run as PDF; the dialog has asked about a file that exists. Raises RunError."""
    write_report(_report(path), Path(target), replace=True)
    return target


def render_run_report(path: str) -> list[bytes]:
    """Pages of the report of a run, as PNG images. Raises RunError."""
    return render_pages(_report(path), _PRINTED_DPI)


def _report(path: str) -> Report:
    return build_run_report(Path(path), read_head(datetime.datetime.now().astimezone().date()))
