"""Write JSON schemas of what `--json` prints: `python -m tools.json_schemas`.

`docs/reference/schemas/NAME.schema.json`, JSON Schema 2020-12. Objects may have further keys: later versions
add some, and never rename or remove one. `tests/test_json_schemas.py` holds real output against them.
"""

import json
from pathlib import Path
from typing import Any, Final

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "reference" / "schemas"
Schema = dict[str, Any]

NUMBER: Final[Schema] = {"type": "number"}
COUNT: Final[Schema] = {"type": "integer", "minimum": 0}
TEXT: Final[Schema] = {"type": "string"}
YES: Final[Schema] = {"type": "boolean"}


def optional(schema: Schema) -> Schema:
    """The same, or null."""
    kinds = schema.get("type")
    return (
        schema | {"type": [kinds, "null"]}
        if isinstance(kinds, str)
        else {"anyOf": [schema, {"type": "null"}]}
    )


def listed(schema: Schema, description: str = "") -> Schema:
    """List of such elements."""
    return {"type": "array", "items": schema} | ({"description": description} if description else {})


def keyed(schema: Schema, description: str = "") -> Schema:
    """Object with such a value by each key."""
    found = {"type": "object", "additionalProperties": schema}
    return found | ({"description": description} if description else {})


def record(required: Schema, others: Schema | None = None, description: str = "") -> Schema:
    """Object with required keys and others."""
    found = {"type": "object", "properties": required | (others or {}), "required": list(required)}
    return found | ({"description": description} if description else {})


INTERVAL: Final = optional({"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2})
QUANTITY: Final = record(
    {"value": NUMBER, "standard_uncertainty": optional(NUMBER), "interval_95": INTERVAL, "unit": TEXT},
    description="A value with standard uncertainty and 95 % interval, in an SI unit; 1 is a pure number.",
)
RESULT: Final = {"anyOf": [QUANTITY, TEXT, YES]}
WARNING: Final = record({"code": TEXT, "message": TEXT})
BUDGET: Final = listed(
    record({"source": TEXT, "contribution_to": TEXT, "standard_uncertainty": optional(NUMBER)}),
    "Contribution of each source to each uncertainty; null is not stated.",
)
MODEL: Final = record(
    {
        "name": TEXT,
        "adequate": YES,
        "residual_rms_m": NUMBER,
        "noise_rms_m": NUMBER,
        "degree": {"enum": ["ideal", "stand", "friction", "none"]},
        "parts": listed(TEXT, "Effects of the stand in the chosen model."),
        "residual_share": optional(NUMBER),
        "tried": listed(record({"name": TEXT, "bic": NUMBER, "residual_rms_m": NUMBER})),
    }
)
PROGRAM: Final = {"program": TEXT, "version": TEXT, "commit": optional(TEXT), "date": TEXT}
SOURCE: Final[Schema] = {"enum": ["real", "simulated", "imported"]}
ORIGIN_OF_RUN: Final = PROGRAM | {
    "request": keyed({"type": ["string", "number"]}, "What was asked for: law, kind, options given."),
    "request_hash": TEXT,
    "inputs_hash": TEXT,
    "run_identifier": TEXT,
    "source": SOURCE,
    "masses": keyed(NUMBER),
    "gravity_m_per_s2": NUMBER,
    "reproduce": TEXT,
}
ORIGIN: Final = record(
    ORIGIN_OF_RUN | {"calibrations": keyed(record({"identity": TEXT}), "By gauge: table, relative.")},
    description="What made a result, and of what; `reproduce` is the command that gives the same digits.",
)
ORIGIN_OF_TABLE: Final = record(
    PROGRAM
    | {
        "source": TEXT,
        "inputs_hash": TEXT,
        "reproduce": TEXT,
        "calibrations": keyed(record({"identity": TEXT}), "By identity."),
        "runs": listed(
            record(ORIGIN_OF_RUN | {"run": TEXT, "analysis": optional(COUNT), "calibrations": keyed(TEXT)})
        ),
    }
)
ANALYSIS: Final = record(
    {
        "schema": {"const": "slipstand-analysis/1"},
        "run": optional(TEXT),
        "series": optional(TEXT),
        "kind": {"enum": ["two-mass", "one-mass"]},
        "results": keyed(RESULT, "By the name of the quantity; what cannot be determined is absent."),
        "model": optional(MODEL),
        "budget": BUDGET,
        "events": record({name: optional(NUMBER) for name in ("release_s", "slip_end_s", "rest_s")}),
        "warnings": listed(WARNING),
        "quality": record(dict.fromkeys(("samples", "missing", "damaged", "overloaded"), COUNT)),
    },
    {"origin": ORIGIN},
)
FAILURE: Final = record({"run": TEXT, "error": TEXT})
TABLE_MASS: Final = record(
    {"kind": {"const": "table-mass"}, "runs": listed(TEXT), "results": keyed(QUANTITY)}
)
MOTION: Final = {
    "residual_displacement_m": NUMBER,
    "slip_end_s": NUMBER,
    "phases": COUNT,
    "table_velocity_max_m_per_s": NUMBER,
    "plate_velocity_max_m_per_s": NUMBER,
    "table_acceleration_max_m_per_s2": NUMBER,
    "parameters": keyed({"type": ["number", "string", "null"]}),
}
FLAGS: Final = (
    "stiffness_n_per_m", "stiffness_kgf_per_m", "damping", "velocity", "acceleration", "breakaway",
    "residual_within_1_mm", "residual_within_2_mm", "residual_unreachable",
)  # fmt: skip

SCHEMAS: Final[dict[str, tuple[str, Schema]]] = {
    "analyze": ("slipstand analyze RUN... --json", listed({"anyOf": [ANALYSIS, FAILURE, TABLE_MASS]})),
    "table": (
        "slipstand table RUN|DIR... --json",
        record(
            {
                "schema": TEXT,
                "rows": listed(record({"series": TEXT, "runs": listed(TEXT)})),
                "effects": listed({"type": "object"}),
                "excluded": listed(record({"run": TEXT, "reason": TEXT})),
                "failures": listed(FAILURE),
                "warnings": listed(WARNING),
                "origin": ORIGIN_OF_TABLE,
            }
        ),
    ),
    "simulate": (
        "slipstand simulate --json",
        record(MOTION | {"stiffness_n_per_m": NUMBER, "damping_coefficient_kg_per_s": NUMBER}),
    ),
    "plan": (
        "slipstand plan --json",
        record(
            MOTION
            | {
                "series": optional(TEXT),
                "law": TEXT,
                "rest_s": optional(NUMBER),
                "msk64_degree": TEXT,
                "gauges": keyed(record({"lowest_m": NUMBER, "highest_m": NUMBER, "fits": YES})),
                "tests_without_recentring": optional(COUNT),
                "results": keyed(QUANTITY),
                "budget": BUDGET,
                "warnings": listed(WARNING),
            }
        ),
    ),
    "audit": (
        "slipstand audit --json",
        record(
            {
                "rows": listed(record({"series": TEXT, "flags": listed(TEXT)})),
                "counts": record(dict.fromkeys(FLAGS, COUNT)),
            }
        ),
    ),
    "runs": (
        "slipstand runs --json",
        listed(
            record(
                {
                    "path": TEXT,
                    "fault": TEXT,
                    "series": optional(TEXT),
                    "start_time": optional(TEXT),
                    "samples": COUNT,
                    "ended": TEXT,
                    "friction_dynamic": optional(NUMBER),
                    "friction_dynamic_uncertainty": optional(NUMBER),
                    "stale": YES,
                    "excluded": TEXT,
                }
            )
        ),
    ),
    "record": (
        "slipstand record --json; a list with --count",
        record(
            {
                "run": TEXT,
                "samples": COUNT,
                "missing": COUNT,
                "damaged": COUNT,
                "overloaded": COUNT,
                "rate_hz": optional(NUMBER),
                "ended": {
                    "enum": [
                        "rest", "enough", "duration", "stopped", "device-lost", "stalled", "trigger-timeout",
                        "disk-full", "write-error", "interrupted",
                    ]
                },
            }
        ),
    ),
    "import": (
        "slipstand import FILE -o RUN.h5 --json; a list for several files",
        record(
            {
                "run": TEXT,
                "samples": COUNT,
                "file": TEXT,
                "duration_s": NUMBER,
                "rate_hz": optional(NUMBER),
                "start_time": optional(TEXT),
                "release_s": optional(NUMBER),
                "notes": listed(TEXT),
            }
        ),
    ),
    "export": (
        "slipstand export --json",
        listed(record({"run": TEXT, "files": listed(TEXT), "error": TEXT, "note": TEXT})),
    ),
    "device-list": (
        "slipstand device list --json",
        listed(
            record({"protocol": TEXT, "name": TEXT, "settings": keyed(TEXT), "title": TEXT, "available": YES})
        ),
    ),
    "doctor": (
        "slipstand doctor --json",
        record(
            {
                "ok": YES,
                "checks": listed(record(dict.fromkeys(("subject", "state", "message", "remedy"), TEXT))),
            }
        ),
    ),
}  # fmt: skip
"""By name: the command, and what it prints."""


def schema_text(name: str) -> str:
    """Content of a schema's file."""
    command, schema = SCHEMAS[name]
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": command}
    return json.dumps(head | schema, indent=2) + "\n"


def main() -> None:
    """Write all schemas."""
    FOLDER.mkdir(exist_ok=True)
    for name in SCHEMAS:
        (FOLDER / f"{name}.schema.json").write_text(schema_text(name), encoding="utf-8")


if __name__ == "__main__":
    main()
