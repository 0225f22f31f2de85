"""The table as a JSON document, schema `slipstand-table/1`."""

from typing import Any, Final

import msgspec

from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.rows import SeriesRow
from analysis.quantities import Quantity
from app.reports.table.content import PublishedRowComparison, TableContent
from app.runs.export.json_files import plain

SCHEMA: Final = "slipstand-table/1"


def table_document(content: TableContent) -> dict[str, Any]:
    """All that the table says; what was not determined is absent, what is not finite null."""
    campaign = content.campaign
    document: dict[str, Any] = plain(
        {
            "schema": SCHEMA,
            "rows": [_row(row, (content.published or {}).get(row.label)) for row in campaign.rows],
            "effects": msgspec.to_builtins(campaign.effects.effects),
            "scatter_beyond_effects": campaign.effects.scatter,
            "ratios": msgspec.to_builtins(campaign.ratios),
            "msk64_degrees": list(campaign.msk64_degrees),
            "excluded": msgspec.to_builtins(campaign.excluded),
            "failures": [{"run": run, "error": error} for run, error in content.failures],
            "warnings": msgspec.to_builtins(content.all_warnings()),
        }
    )
    return document


def _row(row: SeriesRow, printed: PublishedRowComparison | None) -> dict[str, Any]:
    found: dict[str, Any] = {
        "series": row.label,
        "contact": row.series.contact,
        "pullback_m": row.series.pullback_m,
        "table_mass_kg": row.series.table_mass_kg,
        "runs": list(row.runs),
        **{name: _pooled(pooled) for name, pooled in row.quantities.items()},
        "warnings": msgspec.to_builtins(row.warnings),
    }
    if row.msk64_degree:
        found["msk64_degree"] = row.msk64_degree
    if printed is not None:
        figures = {
            one.name: {"printed": one.published, "difference": one.difference} for one in printed.figures
        }
        found["published"] = {"figures": figures, "flags": list(printed.flags)}
    return found


def _pooled(pooled: PooledQuantity) -> dict[str, Any]:
    described: dict[str, Any] = msgspec.to_builtins(pooled)
    described.pop("quantity")
    return _quantity(pooled.quantity) | described


def _quantity(quantity: Quantity) -> dict[str, Any]:
    described: dict[str, Any] = msgspec.to_builtins(quantity)
    return described | {"interval_95": list(quantity.interval_95)}
