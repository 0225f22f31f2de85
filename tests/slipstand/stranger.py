"""The script of a laboratory that has installed the wheel; it gets a folder, and writes what it found."""

import json
import sys
from pathlib import Path

import config
import slipstand


def main(folder: Path) -> None:
    test = slipstand.simulate("1FFM0", seed=1)
    by_arrays: slipstand.Result = slipstand.identify(
        slipstand.Record.from_arrays(
            test.record.time_s,
            test.record.table_displacement_m,
            test.record.relative_displacement_m,
            table_mass_kg=131.6,
            plate_mass_kg=22.4,
        )
    )
    run = slipstand.read_run(folder / "run.h5")
    result = slipstand.identify(run)
    result.plot().savefig(folder / "figure.png")
    pooled = slipstand.pool(folder)
    (folder / "results.csv").write_text(result.to_dataframe().to_csv())
    friction: slipstand.Quantity = result["friction_dynamic"]
    found = {
        "package": slipstand.__file__,
        "own_config": config.LABORATORY,
        "friction": friction.value,
        "standard_uncertainty": friction.standard_uncertainty,
        "by_arrays": by_arrays["friction_dynamic"].value,
        "pooled": pooled.to_dict()["rows"][0]["friction_dynamic"]["value"],
        "warnings": [warning.code for warning in result.warnings],
        "names": sorted({"app", "analysis", "drivers", "messages"} & set(sys.modules)),
    }
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
