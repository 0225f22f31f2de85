"""`slipstand audit`: whether a published table agrees with itself and with the equations of motion."""

from dataclasses import asdict

import msgspec

from analysis.audit import AuditedRow, PublishedRow, count_flags
from analysis.audit import audit as check
from app.cli import output as out
from app.cli.result_options import AuditOptions
from config.files import load_published_rows, load_stand, published_table


def audit(options: AuditOptions) -> None:
    given = options.table
    rows = load_published_rows(given.expanduser()) if given else list(published_table().values())
    stand = load_stand()
    audited = check(
        msgspec.convert(rows, list[PublishedRow], from_attributes=True),
        table_mass_kg=stand.table_mass_kg,
        pullbacks_m={row.series: stand.series(row.series).pullback_m for row in rows},
        gravity_m_per_s2=stand.gravity_m_per_s2,
    )
    if options.as_json:
        rows_found = [
            {"series": row.series, "flags": row.flags, "checks": [asdict(check) for check in row.checks]}
            for row in audited
        ]
        out.print_json({"rows": rows_found, "counts": count_flags(audited)})
    else:
        _print_report(audited)


def _print_report(audited: list[AuditedRow]) -> None:
    rows = [
        (row.series, check.flag, f"{check.printed:.4g}", f"{check.expected:.4g}")
        for row in audited
        for check in row.checks
        if check.flagged
    ]
    out.print_table(("series", "flag", "printed", "expected"), rows)
    out.print_line("")
    out.print_table(("flag", "rows"), [(flag, str(count)) for flag, count in count_flags(audited).items()])
