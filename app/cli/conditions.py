"""Options for the circumstances of a test, which `record` and `import` share."""

from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.options import key_values

if TYPE_CHECKING:
    from app.runs.metadata import Conditions

Temperature = Annotated[float | None, typer.Option("--temperature", help="Air temperature (degrees C).")]
Humidity = Annotated[float | None, typer.Option("--humidity", help="Relative humidity of the air (%).")]
PlateId = Annotated[str, typer.Option("--plate-id", help="Which upper plate.")]
ContactId = Annotated[str, typer.Option("--contact-id", help="Which pair of surfaces.")]
Surface = Annotated[str, typer.Option("--surface", help="How the surfaces were prepared.")]
RunIn = Annotated[
    int | None,
    typer.Option("--run-in", help="Which pullback on these surfaces; counted up by `record --count`."),
]
OtherConditions = Annotated[
    list[str] | None,
    typer.Option("--condition", metavar="NAME=TEXT", help="Any other circumstance; repeatable."),
]


def conditions_of(
    temperature: float | None,
    humidity: float | None,
    plate_id: str,
    contact_id: str,
    surface: str,
    run_in: int | None,
    other: list[str] | None,
) -> "Conditions":
    """Put the options together, checked. Raises CommandError, MetadataError."""
    from app.runs.metadata import Conditions

    return Conditions(
        temperature_c=temperature,
        humidity_percent=humidity,
        plate_id=plate_id.strip(),
        contact_id=contact_id.strip(),
        surface_preparation=surface.strip(),
        run_in_number=run_in,
        other=key_values(other, "--condition"),
    )
