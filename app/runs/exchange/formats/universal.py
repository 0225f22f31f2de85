"""Universal files, dataset 58, by pyuff."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.content import import_optional
from app.runs.exchange.csv_layout import FileLayout
from app.runs.exchange.tables import Table, TimeAxis, check_file_size, even_axis

_TIME_RESPONSE = 1


def open_table(path: Path, _layout: FileLayout, _report: ReportShare) -> Table:
    """Time responses by their second line of text; one that comes twice has node and direction beside."""
    check_file_size(path)
    file = import_optional("pyuff", "UFF 58").UFF(str(path))
    places = [place for place, kind in enumerate(file.get_set_types()) if int(kind) == 58]
    sets: list[dict[str, Any]] = [file.read_sets(place) for place in places]
    sets = [one for one in sets if one.get("func_type") == _TIME_RESPONSE]
    if not sets:
        raise ImportFileError("{path} holds no time response of dataset 58. Export one", path=path)
    labels = [_text(one, "id2") for one in sets]
    nodes = [f"{one.get('rsp_node')}:{one.get('rsp_dir')}" for one in sets]
    names = [
        label if label and labels.count(label) == 1 else f"{label} {node}".strip()
        for label, node in zip(labels, nodes, strict=True)
    ]

    def column(at: int) -> NDArray[Any]:
        return np.asarray(sets[at]["data"])

    def axis(at: int) -> TimeAxis | None:
        one = sets[at]
        if one.get("abscissa_spacing") == 1:
            rows = len(one["data"])
            return even_axis(rows, float(one["abscissa_inc"]), float(one.get("abscissa_min", 0.0)))
        return TimeAxis(np.array(one["x"], np.float64))

    units = [_text(one, "ordinate_axis_units_lab") for one in sets]
    return Table(names, column, units=units, axis=axis, has_axis=True)


def _text(one: dict[str, Any], name: str) -> str:
    text = str(one.get(name, "")).strip()
    return "" if text.upper() == "NONE" else text
