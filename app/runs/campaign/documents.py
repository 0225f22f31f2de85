"""Parts of a campaign as JSON."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import msgspec

from analysis.campaign.pooling import PooledQuantity
from analysis.campaign.stand_effects import EffectSummary
from app.runs.analysis_json import quantity_document

Document = dict[str, Any]


def effect_documents(effects: Iterable[EffectSummary]) -> list[Document]:
    """Effects of the stand over several runs, with sizes by name of the result."""
    return [
        {
            "name": effect.name,
            "contact": effect.contact,
            "scope": effect.scope.value,
            "runs": list(effect.runs),
            "run_count": effect.run_count,
            "share_95": list(effect.share_95),
            "deviating": list(effect.deviating),
            "sizes": {name: pooled_document(size) for name, size in effect.sizes.items()},
            "pullback_m": effect.pullback_m,
            "message": str(effect.message),
        }
        for effect in effects
    ]


def pooled_document(pooled: PooledQuantity) -> Document:
    """A pooled quantity with its scatter, and its shared errors by name."""
    shared = {str(error): deviation for error, deviation in pooled.common.items()}
    described: Document = msgspec.to_builtins(replace(pooled, common={})) | {"common": shared}
    described.pop("quantity")
    return quantity_document(pooled.quantity) | described
