"""What `--json` prints, held against the published schemas with no key beyond them."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import jsonschema

from tools.json_schemas import SCHEMAS


def closed(schema: Any) -> Any:
    """The same schema without further keys: a key that it lacks is an error."""
    if isinstance(schema, list):
        return [closed(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    made = {name: closed(one) for name, one in schema.items()}
    properties = schema.get("properties")
    if isinstance(properties, dict):
        made["properties"] = {name: closed(one) for name, one in properties.items()}
        made.setdefault("additionalProperties", False)
    return made


@cache
def validator(name: str) -> jsonschema.Draft202012Validator:
    """Validator of the closed schema of a command."""
    return jsonschema.Draft202012Validator(closed(SCHEMAS[name][1]))


def check(name: str, document: object) -> None:
    """Raise ValidationError unless the document is what the schema says, and nothing else."""
    fault = jsonschema.exceptions.best_match(validator(name).iter_errors(document))
    if fault is not None:
        raise jsonschema.ValidationError(f"{name}: {fault.json_path}: {fault.message}")


def schema_name(arguments: Sequence[str]) -> str:
    """Name of the schema of what a command with `--json` prints; "" where it is no such command."""
    if "--json" not in arguments or arguments[0] == "--verbose":
        return ""
    two = "-".join(arguments[:2])
    if two in SCHEMAS:
        return two
    return "demo-campaign" if arguments[0] == "demo" and "--campaign" in arguments else arguments[0]


def check_output(arguments: Sequence[str], document: object) -> None:
    """Check what a command with `--json` printed."""
    name = schema_name(arguments)
    if name:
        check(name, document)
