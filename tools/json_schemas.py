"""Write JSON schemas of what `--json` prints: `python -m tools.json_schemas`.

`docs/reference/schemas/NAME.schema.json`, JSON Schema 2020-12. Objects may have further keys: later versions
add some, and never rename or remove one. Tests hold real output of every command against them, and refuse
keys that they do not have.
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


def one_or_list(required: Schema) -> Schema:
    """Object with required keys, or a list of them."""
    one = record(required)
    return {"anyOf": [one, listed(one)]}


def keyed(schema: Schema, description: str = "") -> Schema:
    """Object with such a value by each key."""
    found = {"type": "object", "additionalProperties": schema}
    return found | ({"description": description} if description else {})


def record(required: Schema, others: Schema | None = None, description: str = "") -> Schema:
    """Object with required keys and others."""
    found = {"type": "object", "properties": required | (others or {}), "required": list(required)}
    return found | ({"description": description} if description else {})


INTERVAL: Final = optional({"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2})
EXPANDED: Final = {
    "expanded_uncertainty": optional(NUMBER)
    | {"description": "Standard uncertainty times the coverage factor; absent in older results."},
    "coverage_factor": NUMBER,
}
QUANTITY: Final = record(
    {"value": NUMBER, "standard_uncertainty": optional(NUMBER), "interval_95": INTERVAL, "unit": TEXT},
    EXPANDED,
    description="A value with standard uncertainty and 95 % interval, in an SI unit; 1 is a pure number.",
)
RESULT: Final = {"anyOf": [QUANTITY, TEXT, YES]}
ANY: Final[Schema] = {}
WARNING: Final = record(
    {"code": TEXT, "message": TEXT},
    {"template": TEXT, "values": keyed(ANY, "What stands in the places of the template."), "plural": TEXT},
)
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
        "tried": listed(
            record(
                {"name": TEXT, "bic": NUMBER, "residual_rms_m": NUMBER},
                {"friction_dynamic": NUMBER, "parts": listed(TEXT)},
            )
        ),
    }
)
GAUGE: Final = record(
    {"identity": TEXT, "gain_m_per_count": NUMBER, "zero_count": NUMBER},
    {
        **dict.fromkeys(
            (
                "gain_relative_standard_uncertainty", "zero_standard_uncertainty_m", "nonlinearity_m",
                "delay_s", "delay_standard_uncertainty_s", "range_m", "hysteresis_m", "repeatability_m",
            ),
            NUMBER,
        ),
        **dict.fromkeys(
            (
                "measures", "serial_number", "reference", "date", "valid_until", "certificate",
                "calibrated_by",
            ),
            TEXT,
        ),
        "polynomial": listed(NUMBER),
        "filter": {"type": "object", "additionalProperties": True},
    },
    "Calibration of a gauge, as its file states it.",
)  # fmt: skip
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
FURTHER_ORIGIN: Final = {
    "source_file": optional(record({"name": TEXT, "sha256": TEXT, "size_bytes": COUNT})),
    "gravity_standard_uncertainty_m_per_s2": optional(NUMBER),
}
ORIGIN: Final = record(
    ORIGIN_OF_RUN | {"calibrations": keyed(GAUGE, "By gauge: table, relative.")},
    FURTHER_ORIGIN,
    description="What made a result, and of what; `reproduce` is the command that gives the same digits.",
)
ORIGIN_OF_TABLE: Final = record(
    PROGRAM
    | {
        "source": TEXT,
        "inputs_hash": TEXT,
        "reproduce": TEXT,
        "calibrations": keyed(GAUGE, "By identity."),
        "runs": listed(
            record(
                ORIGIN_OF_RUN | {"run": TEXT, "analysis": optional(COUNT), "calibrations": keyed(TEXT)},
                FURTHER_ORIGIN,
            )
        ),
    }
)
EVENTS: Final = record(
    {name: optional(NUMBER) for name in ("release_s", "slip_end_s", "rest_s")},
    {
        name: optional(NUMBER)
        for name in (
            "free_decay_end_s", "release_uncertainty_s", "slip_end_uncertainty_s", "rest_uncertainty_s",
        )
    },
)  # fmt: skip
PLATE: Final = record(
    {
        "slips": listed(
            record(
                dict.fromkeys(
                    (
                        "time_s", "friction", "friction_standard_uncertainty", "position_m", "speed_m_per_s",
                        "path_m",
                    ),
                    NUMBER,
                )
            )
        ),
        "variation": keyed(
            record({"per_unit": NUMBER, "standard_uncertainty": NUMBER, "is_significant": YES}),
            "By covariate.",
        ),
    },
    dict.fromkeys(("gauge_2_lag_s", "gauge_2_lag_standard_uncertainty_s"), optional(NUMBER)),
    "Friction of each slip, from the plate alone.",
)  # fmt: skip
CLASSICAL: Final = record(
    {"log_decrement": optional(QUANTITY), "notes": listed(TEXT)},
    {
        "period_s": optional(NUMBER),
        "cycles": optional(COUNT),
        "friction_of_residual": listed(NUMBER),
        "friction_of_paper": optional(NUMBER),
    },
    "The paper's own figures.",
)
MONTE_CARLO: Final = record(
    {
        "draws": COUNT,
        "refits": COUNT,
        "compared": {"enum": ["draws", "refits"]},
        "results": keyed(
            record(
                {
                    "budget": QUANTITY,
                    "drawn": QUANTITY,
                    "refitted": optional(QUANTITY),
                    "difference": optional(NUMBER),
                    "tolerance": NUMBER,
                    "agrees": YES,
                }
            )
        ),
    }
)
TRUTH: Final = keyed(ANY, "True values of the simulated stand.")
ANALYSIS: Final = record(
    {
        "schema": {"const": "slipstand-analysis/1"},
        "run": optional(TEXT),
        "series": optional(TEXT),
        "kind": {"enum": ["two-mass", "one-mass"]},
        "results": keyed(RESULT, "By the name of the quantity; what cannot be determined is absent."),
        "model": optional(MODEL),
        "budget": BUDGET,
        "events": EVENTS,
        "warnings": listed(WARNING),
        "quality": record(
            dict.fromkeys(("samples", "missing", "damaged", "overloaded"), COUNT),
            {"missing_estimated": COUNT},
        ),
    },
    {
        "origin": ORIGIN,
        "plate": optional(PLATE),
        "classical": optional(CLASSICAL),
        "monte_carlo": MONTE_CARLO,
        "truth": TRUTH | {"description": "Of `demo` alone: true values of the simulated stand."},
        "figure": TEXT,
    },
)
FAILURE: Final = record({"run": TEXT, "error": TEXT})
TABLE_MASS: Final = record(
    {"kind": {"const": "table-mass"}, "runs": listed(TEXT), "results": keyed(QUANTITY)}
)
POOLED: Final = record(
    {"value": NUMBER, "standard_uncertainty": NUMBER, "interval_95": INTERVAL, "unit": TEXT},
    EXPANDED
    | {
        "runs": COUNT,
        "repeatable": NUMBER,
        "common": keyed(NUMBER, "Standard uncertainties that runs share, by source."),
        **dict.fromkeys(("between_runs", "scatter", "birge_ratio", "degrees_of_freedom"), optional(NUMBER)),
        "outliers": listed(TEXT),
    },
)
EFFECT_OF_STAND: Final = record(
    {
        "name": TEXT,
        "contact": optional(TEXT),
        "scope": TEXT,
        "runs": listed(TEXT),
        "run_count": COUNT,
        "share_95": listed(NUMBER),
        "deviating": listed(TEXT),
        "sizes": keyed(POOLED),
        "pullback_m": optional(NUMBER),
        "message": TEXT,
    }
)
EFFECT: Final = record(
    {
        "cause": TEXT,
        "found": optional(YES),
        "sentence": TEXT,
        "statistic": optional(NUMBER),
        "p_value": optional(NUMBER),
        "degrees_of_freedom": optional(listed(COUNT)),
        "sizes": listed(record({"step": TEXT, "change": QUANTITY})),
        "size_seen": optional(NUMBER),
    }
)
ROW: Final = record(
    {
        "series": TEXT,
        "contact": optional(TEXT),
        "pullback_m": optional(NUMBER),
        "table_mass_kg": NUMBER,
        "runs": listed(TEXT),
        "warnings": listed(WARNING),
        "source": TEXT,
    },
    {
        "msk64_degree": TEXT,
        "published": record(
            {
                "figures": keyed(record({"printed": NUMBER, "difference": optional(NUMBER)})),
                "flags": listed(TEXT),
            }
        ),
    },
) | {"additionalProperties": POOLED}
MOTION: Final = {
    "residual_displacement_m": NUMBER,
    "slip_end_s": NUMBER,
    "phases": COUNT,
    "table_velocity_max_m_per_s": NUMBER,
    "plate_velocity_max_m_per_s": NUMBER,
    "table_acceleration_max_m_per_s2": NUMBER,
    "plate_acceleration_max_m_per_s2": NUMBER,
    "parameters": keyed({"type": ["number", "string", "null"]}),
}
FLAGS: Final = (
    "stiffness_n_per_m", "stiffness_kgf_per_m", "damping", "velocity", "acceleration", "breakaway",
    "residual_within_1_mm", "residual_within_2_mm", "residual_unreachable",
)  # fmt: skip

IMPORTED: Final = record(
    {
        "run": TEXT,
        "samples": COUNT,
        "file": TEXT,
        "duration_s": NUMBER,
        "rate_hz": optional(NUMBER),
        "start_time": optional(TEXT),
        "table_range": listed(NUMBER, "Smallest and largest reading of gauge 1, in `unit`."),
        "unit": TEXT,
        "release_s": optional(NUMBER),
        "notes": listed(TEXT),
    },
    {"relative_range": optional(listed(NUMBER, "The same of gauge 2."))},
)
UNREAD: Final = record({"file": TEXT, "error": TEXT})
GAUGE_NAME: Final[Schema] = {"enum": ["table", "relative"]}
GRADE: Final[Schema] = {"enum": ["good", "doubtful", "bad"]}

SCHEMAS: Final[dict[str, tuple[str, Schema]]] = {
    "analyze": ("slipstand analyze RUN... --json", listed({"anyOf": [ANALYSIS, FAILURE, TABLE_MASS]})),
    "table": (
        "slipstand table RUN|DIR... --json",
        record(
            {
                "schema": TEXT,
                "rows": listed(ROW),
                "effects": listed(EFFECT, "What f_d depends on."),
                "scatter_beyond_effects": optional(NUMBER),
                "effects_of_stand": listed(EFFECT_OF_STAND),
                "ratios": listed(
                    record(
                        {
                            "contact": TEXT,
                            "ratio": optional(QUANTITY),
                            "series": COUNT,
                            "between_series": optional(NUMBER),
                            "bounds": listed(optional(NUMBER)),
                        }
                    ),
                    "f_s / f_d by contact.",
                ),
                "msk64_degrees": listed(TEXT),
                "excluded": listed(record({"run": TEXT, "reason": TEXT})),
                "failures": listed(FAILURE),
                "warnings": listed(WARNING),
                "origin": ORIGIN_OF_TABLE,
            }
        ),
    ),
    "simulate": (
        "slipstand simulate --json",
        record(
            MOTION | {"stiffness_n_per_m": NUMBER, "damping_coefficient_kg_per_s": NUMBER},
            {"file": TEXT, "effects": keyed(NUMBER)},
        ),
    ),
    "plan": (
        "slipstand plan --json",
        record(
            MOTION
            | {
                "series": optional(TEXT),
                "law": TEXT,
                **dict.fromkeys(
                    ("rate_hz", "duration_s", "noise_m", "period_s", "smallest_pullback_m"), NUMBER
                ),
                "rest_s": optional(NUMBER),
                "msk64_degree": TEXT,
                "gauges": keyed(
                    record(
                        {"lowest_m": NUMBER, "highest_m": NUMBER, "fits": YES},
                        {"range_m": optional(NUMBER), "share": optional(NUMBER)},
                    )
                ),
                "tests_without_recentring": optional(COUNT),
                "results": keyed(QUANTITY),
                "noise_part": optional(NUMBER),
                "stated_part": optional(NUMBER),
                "halved_by": listed(
                    record(
                        {
                            "means": TEXT,
                            "value": optional(NUMBER),
                            "standard_uncertainty": optional(NUMBER),
                            "message": TEXT,
                        }
                    )
                ),
                "last_runs": optional(
                    record(
                        {
                            "folder": TEXT,
                            "runs": listed(TEXT),
                            "effects_of_stand": listed(EFFECT_OF_STAND),
                            "planned_with": listed(TEXT),
                            "model_spread": optional(NUMBER),
                            "ideal_standard_uncertainty": optional(NUMBER),
                            "friction_dynamic": optional(
                                record(
                                    {
                                        "runs": COUNT,
                                        **dict.fromkeys(
                                            (
                                                "noise", "between_runs", "model", "shared",
                                                "standard_uncertainty",
                                            ),
                                            optional(NUMBER),
                                        ),
                                        "runs_to_halve": optional(COUNT),
                                        "message": TEXT,
                                    }
                                )
                            ),
                        }
                    )
                ),
                "budget": BUDGET,
                "warnings": listed(WARNING),
            }
        ),
    ),
    "audit": (
        "slipstand audit --json",
        record(
            {
                "rows": listed(
                    record(
                        {
                            "series": TEXT,
                            "flags": listed(TEXT),
                            "checks": listed(
                                record({"flag": TEXT, "flagged": YES, "printed": NUMBER, "expected": NUMBER})
                            ),
                        }
                    )
                ),
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
                    "period_s": optional(NUMBER),
                    "period_uncertainty_s": optional(NUMBER),
                    "damping_n1_per_s": optional(NUMBER),
                    "damping_n1_uncertainty_per_s": optional(NUMBER),
                    "source": {"enum": ["real", "simulated", "imported", None]},
                    "origin": TEXT | {"description": "Where a run comes from, in words."},
                    "title": TEXT,
                    "operator": TEXT,
                    "note": TEXT,
                    "duration_s": NUMBER,
                    "plate_mass_kg": optional(NUMBER),
                    "pullback_m": optional(NUMBER),
                    "analyses": COUNT,
                    "damaged_analyses": COUNT,
                    "stale": YES,
                    "valid_requests": listed(TEXT, "Hash of each request whose saved result is valid."),
                    "adequate": optional(YES),
                    "friction_holds": YES,
                    "identifier": TEXT,
                    "edits": COUNT,
                    "conditions": record(
                        {
                            "temperature_c": optional(NUMBER),
                            "humidity_percent": optional(NUMBER),
                            "plate_id": TEXT,
                            "contact_id": TEXT,
                            "surface_preparation": TEXT,
                            "run_in_number": optional(COUNT),
                            "other": keyed(TEXT),
                        }
                    ),
                    "excluded": TEXT,
                }
            )
        ),
    ),
    "record": (
        "slipstand record --json; a list with --count",
        one_or_list(
            {
                "run": TEXT,
                "samples": COUNT,
                "missing": COUNT,
                "damaged": COUNT,
                "overloaded": COUNT,
                "missing_estimated": COUNT,
                "rate_hz": optional(NUMBER),
                "release_s": optional(NUMBER),
                "message": TEXT,
                "skew_s": optional(NUMBER),
                "skew_standard_uncertainty_s": optional(NUMBER),
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
        {"anyOf": [IMPORTED, listed({"anyOf": [IMPORTED, UNREAD]})]},
    ),
    "watch": (
        "slipstand watch FOLDER --json",
        listed(
            record(
                {"file": TEXT},
                {**IMPORTED["properties"], "analysis": ANALYSIS, "error": TEXT},
            )
        ),
    ),
    "export": (
        "slipstand export --json",
        listed(
            record(
                {"run": TEXT, "files": listed(TEXT), "error": TEXT, "note": TEXT, "is_simulated": YES},
                {"text": TEXT | {"description": "What would go to stdout without `-o`."}},
            )
        ),
    ),
    "device-list": (
        "slipstand device list --json",
        listed(
            record(
                {
                    "protocol": TEXT,
                    "name": TEXT,
                    "settings": keyed(TEXT),
                    "title": TEXT,
                    "default_baud": optional(COUNT),
                    "available": YES,
                    "verified": TEXT,
                }
            )
        ),
    ),
    "device-ports": (
        "slipstand device ports --json",
        listed(
            record(
                {"device": TEXT, "description": TEXT, "serial_number": TEXT, "location": TEXT}
                | dict.fromkeys(("vendor_id", "product_id"), optional(COUNT))
            )
        ),
    ),
    "device-probe": (
        "slipstand device probe --json",
        listed(
            record(
                {"port": TEXT, "chip": TEXT, "description": TEXT, "serial_number": TEXT}
                | dict.fromkeys(("vendor_id", "product_id"), optional(COUNT))
                | {
                    "outcome": TEXT,
                    "message": TEXT,
                    "holders": listed(record({"process": COUNT, "program": TEXT})),
                    "speaks": optional(
                        record(
                            {
                                "protocol": TEXT,
                                "verified": TEXT,
                                "baud": optional(COUNT),
                                "parity": optional(TEXT),
                                "rate_hz": optional(NUMBER),
                                "channels": COUNT,
                                "settings": keyed(TEXT),
                                "share": NUMBER,
                                "remark": TEXT,
                                "command": TEXT,
                            }
                        )
                    ),
                    "hints": listed(record({"message": TEXT, "remedy": TEXT})),
                }
            )
        ),
    ),
    "device-simulate": (
        "slipstand device simulate --json, one line when the stand can be read",
        record(
            {"port": TEXT, "protocol": TEXT, "rate_hz": NUMBER, "series": TEXT}
            | dict.fromkeys(("truth_file", "calibration"), optional(TEXT))
        ),
    ),
    "device-health": (
        "slipstand device health --json",
        record(
            {
                "schema": {"const": "slipstand-gauge-health/1"},
                "device": TEXT,
                "seconds": NUMBER,
                "gauges": listed(
                    record(
                        {"gauge": GAUGE_NAME, "verdict": GRADE, "samples": COUNT}
                        | dict.fromkeys(
                            (
                                "mean_m", "noise_rms_m", "drift_m_per_min", "swing_m", "step_m", "range_used",
                                "absent_share", "overloaded_share", "clipped_share", "repeated_share",
                                "drift_standard_uncertainty_m_per_min",
                            ),
                            optional(NUMBER),
                        )
                        | {
                            "hum": listed(record({"frequency_hz": NUMBER, "amplitude_m": optional(NUMBER)})),
                            "symptoms": listed(
                                record({"code": TEXT, "verdict": GRADE, "message": TEXT, "remedy": TEXT})
                            ),
                        }
                    )
                ),
            }
        ),
    ),
    "calibrate": (
        "slipstand calibrate --json",
        record(
            {
                "schema": {"const": "slipstand-calibration/1"},
                "gauge": GAUGE_NAME,
                "file": TEXT,
                "in_use": YES,
                "kept": optional(TEXT),
                "gain_m_per_count": QUANTITY,
                "gain_relative_standard_uncertainty": optional(NUMBER),
                "zero_count": QUANTITY,
                "polynomial": listed(NUMBER),
                **dict.fromkeys(
                    (
                        "zero_standard_uncertainty_m", "displacement_standard_uncertainty_m", "scatter_m",
                        "nonlinearity_m", "hysteresis_m", "repeatability_m", "zero_drift_m",
                    ),
                    optional(NUMBER),
                ),
                "filter": optional({"type": "object", "additionalProperties": True}),
                "budget": BUDGET,
                "readings": listed(
                    record(
                        {
                            "counts": NUMBER,
                            "dial_m": NUMBER,
                            "direction": {"enum": ["up", "down"]},
                            "round": COUNT,
                            "residual_m": NUMBER,
                        }
                    )
                ),
                "warnings": listed(WARNING),
            }
        ),
    ),
    "calibrate-check": (
        "slipstand calibrate check --json",
        record(
            {
                "schema": {"const": "slipstand-gauge-check/1"},
                "gauge": GAUGE_NAME,
                "kind": TEXT,
                "date": TEXT,
                "passed": YES,
                **dict.fromkeys(
                    ("expected_m", "measured_m", "deviation_m", "standard_uncertainty_m", "tolerance_m"),
                    NUMBER,
                ),
                "budget": listed(record({"source": TEXT, "standard_uncertainty": optional(NUMBER)})),
                "warnings": listed(WARNING),
            }
        ),
    ),
    "demo": ("slipstand demo --json", ANALYSIS),
    "demo-campaign": (
        "slipstand demo --campaign --json",
        record(
            {
                "schema": {"const": "slipstand-synthetic-campaign/1"},
                "directory": TEXT,
                "options": keyed(ANY),
                "runs": listed(TEXT),
                "failures": listed(FAILURE),
                "inside": COUNT,
                "compared": COUNT,
                "rows": listed(
                    record({"series": TEXT})
                    | {
                        "additionalProperties": record(
                            {
                                "value": NUMBER,
                                "standard_uncertainty": NUMBER,
                                "interval_95": INTERVAL,
                                "truth": NUMBER,
                                "inside": YES,
                            }
                        )
                    }
                ),
            }
        ),
    ),
    "figures": (
        "slipstand figures --json",
        record(
            {
                "figures": listed(
                    record({"figure": TEXT, "file": TEXT, "caption": TEXT, "run": TEXT})
                ),
                "notes": listed(TEXT),
                "failures": listed(FAILURE),
            }
        ),
    ),
    "report": (
        "slipstand report --json",
        record(
            {
                "report": TEXT,
                "number": TEXT,
                "date": TEXT,
                "runs": listed(TEXT),
                "failures": listed(FAILURE),
                "origin": ORIGIN_OF_TABLE,
            }
        ),
    ),
    "recover": (
        "slipstand recover --json",
        listed(
            record(
                {"samples": COUNT}
                | dict.fromkeys(("journal", "state", "run", "ended", "kept", "message"), TEXT)
            )
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
