"""RO-Crate 1.1: runs, their results and where these come from, packed as a ZIP file to be published.

https://www.researchobject.org/ro-crate/1.1/: a file `ro-crate-metadata.json` describes the others in JSON-LD.
Each identification is a `CreateAction` with the run as its object, the result as its result and Slipstand as
its instrument, as the section on provenance asks.
"""

import datetime
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

from app.runs.exchange.content import ExportedRun
from app.version import __version__

Entity = dict[str, Any]
_CONTEXT = "https://w3id.org/ro/crate/1.1/context"
_PROFILE = {"@id": "https://w3id.org/ro/crate/1.1"}
_PROGRAM = {"@id": f"#slipstand-{__version__}"}
_COEFFICIENTS = "coefficients.csv"
_LICENCE = "Not stated: name the licence of the data here before the crate is published."


def write_crate(runs: Sequence[ExportedRun], names: Sequence[str], coefficients: str, path: Path) -> None:
    """Pack runs under their `names`, their results and a table of `coefficients` (CSV) into a ZIP file."""
    parts: list[Entity] = []
    with ZipFile(path, "x", ZIP_DEFLATED) as crate:
        for exported, name in zip(runs, names, strict=True):
            content = exported.run.path.read_bytes()
            crate.writestr(f"runs/{name}.h5", content, ZIP_STORED)  # compressed inside
            run, *others = _run_entities(exported, f"runs/{name}.h5", content)
            parts += [run, *others]
            if exported.analysis is not None:
                result = json.dumps(exported.analysis, indent=2, ensure_ascii=False).encode()
                crate.writestr(f"results/{name}.json", result)
                parts += _result_entities(exported.analysis, run, f"results/{name}.json", result)
        table = coefficients.encode()
        crate.writestr(_COEFFICIENTS, table)
        parts.append(_file(_COEFFICIENTS, "Coefficients of all runs", "text/csv", table))
        entities = {entity["@id"]: entity for entity in (*_root_entities(runs, parts), *parts, _program())}
        document = {"@context": _CONTEXT, "@graph": list(entities.values())}
        crate.writestr("ro-crate-metadata.json", json.dumps(document, indent=2, ensure_ascii=False))


def _root_entities(runs: Sequence[ExportedRun], parts: Sequence[Entity]) -> list[Entity]:
    files = [{"@id": part["@id"]} for part in parts if part["@type"] == "File"]
    actions = [{"@id": part["@id"]} for part in parts if part["@type"] == "CreateAction"]
    series = sorted({exported.run.metadata.series or "" for exported in runs} - {""})
    about = f"Pullback tests on a shaking stand, {len(runs)} runs"
    return [
        {
            "@id": "ro-crate-metadata.json",
            "@type": "CreativeWork",
            "conformsTo": _PROFILE,
            "about": {"@id": "./"},
        },
        {
            "@id": "./",
            "@type": "Dataset",
            "name": about if not series else f"{about} of {', '.join(series)}",
            "description": "Runs as recorded, results of their identification, and how these were obtained.",
            "datePublished": datetime.datetime.now(datetime.UTC).date().isoformat(),
            "license": _LICENCE,
            "hasPart": files,
            "mentions": actions,
        },
    ]


def _run_entities(exported: ExportedRun, name: str, content: bytes) -> list[Entity]:
    """The file of a run, then what it refers to: JSON-LD is to be flat."""
    metadata = exported.run.metadata
    run = _file(name, metadata.title, "application/x-hdf5", content)
    run["identifier"] = exported.run.identifier
    if metadata.start_time is not None:
        run["dateCreated"] = metadata.start_time.isoformat()
    facts = {
        "series": metadata.series,
        "table mass (kg)": metadata.table_mass_kg,
        "plate mass (kg)": metadata.plate_mass_kg,
        "note": metadata.note,
        "origin": metadata.source,
    }
    stated = {key: value for key, value in facts.items() if value}
    values = [
        {"@id": f"#{run['@id']}-{quote(key)}", "@type": "PropertyValue", "name": key, "value": value}
        for key, value in stated.items()
    ]
    run["variableMeasured"] = [{"@id": value["@id"]} for value in values]
    if not metadata.operator:
        return [run, *values]
    person = {"@id": f"#{quote(metadata.operator)}", "@type": "Person", "name": metadata.operator}
    return [run | {"creator": {"@id": person["@id"]}}, *values, person]


def _result_entities(document: Entity, run: Entity, name: str, content: bytes) -> list[Entity]:
    """The file of a result, and the identification that made it."""
    result = _file(name, f"Result of {run['name']}", "application/json", content)
    action = {
        "@id": f"#identification-of-{quote(run['@id'])}",
        "@type": "CreateAction",
        "name": f"Identification of {run['name']}",
        "instrument": _PROGRAM,
        "object": {"@id": run["@id"]},
        "result": {"@id": result["@id"]},
    }
    if (origin := document.get("origin")) and "date" in origin:
        action["endTime"] = origin["date"]
    return [result, action]


def _file(name: str, title: str, encoding: str, content: bytes) -> Entity:
    return {
        "@id": quote(name),
        "@type": "File",
        "name": title,
        "encodingFormat": encoding,
        "contentSize": str(len(content)),
        "sha256": hashlib.sha256(content).hexdigest(),
    }


def _program() -> Entity:
    return _PROGRAM | {"@type": "SoftwareApplication", "name": "Slipstand", "softwareVersion": __version__}
