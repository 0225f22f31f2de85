"""`slipstand analyze A.h5 B.h5 --kind one-mass --added-mass KG`: the table's mass from two free decays."""

from collections.abc import Sequence
from typing import Any

from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.options import positive


def check_added_mass(added_kg: float | None, uncertainty_kg: float, kind: str, runs: int) -> None:
    """Refuse an added mass that cannot be, or does not go with what else was asked. Raises CommandError."""
    positive("--added-mass", added_kg)
    if not 0.0 <= uncertainty_kg < float("inf"):
        raise CommandError(f"--added-mass-uncertainty {uncertainty_kg:g} must be a finite number, 0 or above")
    if added_kg is not None and (kind != "one-mass" or runs != 2):
        raise CommandError(
            "--added-mass needs --kind one-mass and two runs: the bare table first, then the same with the"
            " added mass"
        )
    if added_kg is None and uncertainty_kg:
        raise CommandError("--added-mass-uncertainty goes with --added-mass. Give that too")


def table_mass_of(
    documents: Sequence[dict[str, Any]], added_kg: float, uncertainty_kg: float, as_json: bool
) -> dict[str, Any]:
    """JSON object of the mass of the table from the analyses of two runs, the second with the added mass.

    The time base is common to both runs and cancels, so that the periods count with their noise alone.
    """
    from analysis.one_mass import mass_from_added_mass
    from analysis.quantities import Quantity
    from app.runs.described import describe

    alone, loaded = documents
    added = Quantity.normal(added_kg, uncertainty_kg, "kg")
    mass = mass_from_added_mass(
        _quantity(alone, "period_s"),
        _quantity(loaded, "period_s"),
        added,
        _quantity(alone, "damping_n_per_s"),
        _quantity(loaded, "damping_n_per_s"),
    )
    if not as_json:
        out.say(f"table mass {out.rounded(mass.value, mass.standard_uncertainty)} kg, from both runs")
    return {
        "kind": "table-mass",
        "runs": [document["run"] for document in documents],
        "results": {"table_mass_kg": describe(mass), "added_mass_kg": describe(added)},
    }


def _quantity(document: dict[str, Any], name: str) -> Any:
    """A result with its type A uncertainty."""
    from analysis.quantities import Quantity

    result = document["results"][name]
    noise = [
        line["standard_uncertainty"]
        for line in document["budget"]
        if line["contribution_to"] == name and line["source"] == "noise"
    ]
    return Quantity.normal(result["value"], noise[0] if noise else 0.0, result["unit"])
