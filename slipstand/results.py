"""Results of identifications: as values, as a table, in a notebook, as a data frame."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.catalogue import CATALOGUE, Place, QuantityDefinition
from analysis.identification import Events, Identification, ModelSelection
from analysis.identify import identify as identify_record
from analysis.one_mass.identify import MeasuredQuantity, identify_one_mass
from analysis.quantities import BudgetLine, Quantity, ResultWarning
from analysis.record import Record
from analysis.verdict_text import describe_verdict
from app.runs.analysis_json import unstated_warnings
from app.runs.analysis_request import AnalysisRequest
from app.runs.analyze import analyze_run
from app.runs.origin import SIMULATED_RUN, is_simulated
from app.runs.saved_analyses import analysis_document
from drivers.samples import Losses
from slipstand.runs import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

_COLUMNS = "symbol", "value", "standard_uncertainty", "low_95", "high_95", "unit", "description"


@dataclass(frozen=True, eq=False, repr=False)
class Result(Mapping[str, Quantity]):
    """An identification: its quantities in SI units, by the names of `slipstand analyze --json`."""

    record: Record
    identification: Identification
    """The internal value: fitted curves, the chi-square of f_d, slips of the plate. It may change."""
    document: dict[str, Any]
    """The same as `slipstand analyze --json` prints."""
    title: str = ""
    unit: str = "m"
    """Unit of the readings."""

    def __getitem__(self, name: str) -> Quantity:
        return self.identification.results[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.identification.results)

    def __len__(self) -> int:
        return len(self.identification.results)

    @property
    def kind(self) -> str:
        """`two-mass` or `one-mass`."""
        return self.identification.kind

    @property
    def is_simulated(self) -> bool:
        """Whether the run is of a simulated stand; false of arrays, of which nothing is known."""
        return is_simulated(self.document.get("origin", {}))

    @property
    def labels(self) -> dict[str, str | bool]:
        """Results that are no numbers: `msk64_degree`, `coulomb_significant`."""
        return dict(self.identification.labels)

    @property
    def model(self) -> ModelSelection | None:
        """The chosen law with its degree and residual; None where no law of motion was fitted."""
        return self.identification.model

    @property
    def verdict(self) -> str:
        """One sentence: what the model explains, and whether f_d holds."""
        model = self.identification.model
        return "no law of motion was fitted" if model is None else str(describe_verdict(model, self.kind))

    @property
    def budget(self) -> list[BudgetLine]:
        """Contributions of the sources to the standard uncertainties, without sources that are not stated.

        These are warned of (`gain-not-stated`, `clock-not-timed`).
        """
        lines = self.identification.budget
        return [line for line in lines if np.isfinite(line.standard_uncertainty)]

    @property
    def events(self) -> Events:
        """Times of release, end of slip and rest, in the base of the record."""
        return self.identification.events

    @property
    def warnings(self) -> list[ResultWarning]:
        """What limits the validity of the results, each with a code."""
        return list(self.identification.warnings)

    def correlation(self) -> tuple[list[str], np.ndarray[Any, np.dtype[np.float64]]]:
        """Names of the quantities (m), and the correlation of their errors (m, m).

        It is that of the linearised fit (JCGM 102, 6.2): noise, and every source that quantities share.
        Quantities of which no contributions are known are left out.
        """
        known = self.identification.correlation
        names = [name for name in known.names if name in self] if known else []
        places = [known.names.index(name) for name in names] if known else []
        matrix = known.matrix if known else np.zeros((0, 0))
        return names, matrix[np.ix_(places, places)]

    def to_dataframe(self) -> "DataFrame":
        """Quantities as a data frame of pandas, a row each by name. Raises ImportError without pandas."""
        rows = {row.name: [_label(row), *_numbers(found), row.description] for row, found in self._rows()}
        pandas = _extra("pandas", "to_dataframe")
        frame: DataFrame = pandas.DataFrame.from_dict(rows, orient="index", columns=list(_COLUMNS))
        frame.index.name = "quantity"
        return frame

    def to_gtc(self) -> dict[str, Any]:
        """Quantities as correlated uncertain numbers of GTC, by name. Raises ImportError without GTC.

        Of a quantity whose distribution is not normal, GTC has the standard uncertainty alone.
        """
        gtc = _extra("GTC", "to_gtc")
        names, matrix = self.correlation()
        values = [self[name].value for name in names]
        deviations = [self[name].standard_uncertainty for name in names]
        numbers = gtc.multiple_ureal(values, deviations, np.inf, label_seq=names)
        for row, one in enumerate(numbers):
            for column in range(row):
                gtc.set_correlation(float(matrix[row, column]), one, numbers[column])
        return dict(zip(names, numbers, strict=True))

    def to_uncertainties(self) -> dict[str, Any]:
        """Quantities as correlated numbers of uncertainties, by name. Raises ImportError without it."""
        package = _extra("uncertainties", "to_uncertainties")
        names, matrix = self.correlation()
        values = [(self[name].value, self[name].standard_uncertainty) for name in names]
        numbers = package.correlated_values_norm(values, matrix, tags=names)
        return dict(zip(names, numbers, strict=True))

    def plot(self) -> "Figure":
        """Figure of matplotlib: record, simulation and residuals."""
        from app.reports.figures.record_figure import figure_title, record_figure
        from app.reports.figures.style import print_style

        with print_style():
            figure = record_figure(self.record, self.identification, self.unit)
            figure.suptitle(figure_title(self.title, self.identification), fontsize=10, x=0.01, ha="left")
        return figure

    def __str__(self) -> str:
        cells = [
            (_label(row), str(row.format(found, Place.TERMINAL)), row.description)
            for row, found in self._rows()
        ]
        widths = [max((len(line[column]) for line in cells), default=0) for column in (0, 1)]
        lines = [f"{name:<{widths[0]}}  {value:<{widths[1]}}  {what}" for name, value, what in cells]
        head = [SIMULATED_RUN] if self.is_simulated else []
        return "\n".join(
            [*head, *lines, self.verdict, *(f"warning {one.code}: {one.message}" for one in self.warnings)]
        )

    def __repr__(self) -> str:
        return f"<Result {self.title}>\n{self}" if self.title else str(self)

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{row.symbol.html}</td><td>{escape(str(row.format(found, Place.TERMINAL)))}</td>"
            f"<td style='text-align:left'>{escape(row.description)}</td></tr>"
            for row, found in self._rows()
        )
        notes = "".join(f"<li>{escape(one.code)}: {escape(str(one.message))}</li>" for one in self.warnings)
        head = f"<p><b>{escape(SIMULATED_RUN)}</b></p>" if self.is_simulated else ""
        table = f"<table>{rows}</table><p>{escape(self.verdict)}</p>"
        return f"{head}{table}" + (f"<ul>{notes}</ul>" if notes else "")

    def _rows(self) -> Iterator[tuple[QuantityDefinition, Quantity]]:
        return ((row, self[row.name]) for row in CATALOGUE if row.name in self)


def identify(
    source: Record | Run,
    *,
    model: str = "auto",
    monte_carlo: int | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> Result:
    """Identify friction, stiffness and damping from a record or run, as `slipstand analyze` does.

    Parameters
    ----------
    model : str
        "auto", or the name of a friction law as for `--model`.
    monte_carlo : int, optional
        Check the budget by 1e5 draws through the linearised fit and so many full refits.
    progress : callable, optional
        Called with the share done (0 to 1) and what is being done.

    Raises
    ------
    AnalysisError
        The record holds no free decay that could be analysed, or the model is not known.
    RunError
        The run's readings are no displacements, or the file has vanished.
    """
    report = _reported(progress)
    if isinstance(source, Run):
        return _of_run(source, AnalysisRequest(model, monte_carlo=monte_carlo), report)
    return _of_record(source, identify_record(source, model=model, monte_carlo=monte_carlo, progress=report))


def one_mass(
    source: Record | Run,
    *,
    quantity: MeasuredQuantity = "displacement",
    unit: str = "m",
    mass: Quantity | None = None,
) -> Result:
    """Identify period, damping and Coulomb friction of one free decay, of gauge 1 alone.

    Of a record, `quantity` is what gauge 1 reads, `unit` that of the displacement, and `mass` the moving mass
    (kg), with which stiffness and damping coefficient come. A run knows all three. Raises AnalysisError,
    RunError.
    """
    if isinstance(source, Run):
        return _of_run(source, AnalysisRequest(kind="one-mass"), None)
    return _of_record(source, identify_one_mass(source, quantity=quantity, unit=unit, mass=mass), unit)


def _of_run(run: Run, request: AnalysisRequest, report: Any) -> Result:
    done = analyze_run(run.path, request, progress=report, trusted=True)
    metadata = done.run.metadata
    return Result(done.record, done.identification, done.document, metadata.title, metadata.unit)


def _of_record(record: Record, found: Identification, unit: str = "m") -> Result:
    found.warnings.extend(unstated_warnings(record, found))
    document = analysis_document(None, None, Losses(samples=len(record.time_s)), found)
    return Result(record, found, document, unit=unit)


def _reported(progress: Callable[[float, str], None] | None) -> Callable[[float, Any], None] | None:
    return None if progress is None else lambda share, what: progress(share, str(what))


def _label(row: QuantityDefinition) -> str:
    return f"{row.symbol.text} {row.symbol.relation}".rstrip()


def _numbers(found: Quantity) -> list[Any]:
    return [found.value, found.standard_uncertainty, *found.interval_95, found.unit]


def _extra(module: str, use: str) -> Any:
    """An installed package that is no dependency. Raises ImportError with the remedy."""
    try:
        return import_module(module)
    except ImportError as error:
        raise ImportError(f"{use} needs {module}: pip install {module}") from error
