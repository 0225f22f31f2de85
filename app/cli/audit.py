"""`slipstand audit`: whether a published table agrees with itself and with the equations of motion."""

from analysis.audit import AuditReport
from analysis.audit import audit as check
from app.cli import output as out
from app.cli.result_options import AuditOptions
from config.files import load_published_rows, load_stand, published_table


def audit(options: AuditOptions) -> None:
    given = options.table
    rows = load_published_rows(given.expanduser()) if given else list(published_table().values())
    stand = load_stand()
    report = check(
        rows,
        table_mass_kg=stand.table_mass_kg,
        pullbacks_m={row.series: stand.series(row.series).pullback_m for row in rows},
        gravity_m_per_s2=stand.gravity_m_per_s2,
    )
    if options.as_json:
        rows_found = [{"series": row.series, "flags": row.flags} for row in report.rows]
        out.print_json({"rows": rows_found, "counts": report.counts})
    else:
        _print_report(report)


def _print_report(report: AuditReport) -> None:
    rows = [
        (row.series, check.flag, f"{check.printed:.4g}", f"{check.expected:.4g}")
        for row in report.rows
        for check in row.checks
        if check.flagged
    ]
    out.print_table(("series", "flag", "printed", "expected"), rows)
    out.print_line("")
    out.print_table(("flag", "rows"), [(flag, str(count)) for flag, count in report.counts.items()])
