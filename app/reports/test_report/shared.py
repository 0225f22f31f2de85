"""Sections that the reports of a run and of a campaign share."""

from collections.abc import Sequence
from typing import Final

from matplotlib.figure import Figure

from analysis.catalogue import ACCELERATION, KILOGRAM, MICROMETRE, MILLIMETRE, Unit
from analysis.formatting import NO_BREAK_SPACE, format_compact, format_value, format_with_prefix, typeset
from analysis.laws.catalogue import COMPARED_LAWS, FALLBACK_LAWS
from app.reports.figures.plate_figures import ALL_FIGURES
from app.reports.figures.run_figures import RunFigureData
from app.reports.figures.style import HEIGHT_IN, figure_svg
from app.reports.test_report.blocks import Block, Cell, Drawing, Facts, Grid, Section, Signatures, Text
from app.runs.analyze import Analysis
from app.runs.reader import Fingerprint
from config.schema import Gauge, Gauges, Stand

NOT_STATED = "not stated"

SIGNATURES: Final = Section(
    "Signatures",
    [
        Text("The results are those of the runs named in this report, and of no others."),
        Signatures(["Tested by", "Checked by", "Approved by"]),
    ],
)
PROCEDURE: Final = Section(
    "Procedure",
    [
        Text(
            "The table is pulled back from rest, held, and released without a push. Gauge 1 measures the"
            " table against the fixed base, gauge 2 the upper plate. Both are recorded from the hold until"
            " the table is at rest, or until waiting no longer narrows the results."
        ),
        Text(
            "Both records are compared with the exact motion of two masses with dry friction between them:"
            " period and damping come from the decay after the last slip; f_d, stiffness, damping, pullback,"
            " release and zeros are fitted together to all readings by least squares. The friction laws"
            f" ({', '.join(law.name for law in COMPARED_LAWS)}, and where none of these is adequate"
            f" {', '.join(law.name for law in FALLBACK_LAWS)}) are compared by their likelihood (BIC), and"
            " the chosen one is tested by itself: its residuals must be those of the gauges' noise."
        ),
        Text(
            "Uncertainties are standard uncertainties (coverage factor 1) by the law of propagation of"
            " JCGM 100: the noise of the readings as the residuals show it, and every stated uncertainty of"
            " calibration, masses, gravity, time base and levelling. Expanded uncertainties U are the"
            " standard uncertainties times k = 2, a coverage of about 95 % where the distribution is normal."
            " The 95 % intervals are those of the quantity's own distribution."
        ),
    ],
)


def stand_section(stands: Sequence[Stand]) -> Section:
    return Section("Stand" if len(stands) == 1 else "Stands", [_stand(stand) for stand in stands])


def gauges_section(calibrations: Sequence[Gauges]) -> Section:
    blocks: list[Block] = []
    for gauges in calibrations:
        reference = "base" if gauges.relative.measures == "plate" else "table"
        rows: list[list[Cell]] = [[name, of(gauges.table), of(gauges.relative)] for name, of in _OF_GAUGE]
        header: list[Cell] = ["", "gauge 1, table", f"gauge 2, plate against {reference}"]
        blocks.append(Grid(header, [row for row in rows if any(row[1:])]))
    return Section("Gauges and calibration", blocks)


def fingerprint_columns(prints: Sequence[Fingerprint]) -> list[Block]:
    """Hash of each run file, with its explanation."""
    rows: list[list[Cell]] = [[one.name, f"{one.size_bytes}", one.sha256] for one in prints]
    note = (
        "SHA-256 of the run files as they were when this report was made. The checksums of the samples in"
        " them never change; the files change when an analysis is saved or a note is edited."
    )
    return [Text(note), Grid(["file", "bytes", "SHA-256"], rows, small=True)]


def drawing(figure: Figure, caption: str) -> Drawing:
    return Drawing(figure_svg(figure), caption)


def run_drawings(
    analysis: Analysis, numbers: Sequence[str], prefix: str = "", height_in: float = HEIGHT_IN
) -> list[Drawing]:
    """The figures of a run with these numbers, drawn in `print_style`, that it has something to show in."""
    unit = analysis.run.metadata.unit
    run = RunFigureData.from_identification(analysis.record, analysis.identification, unit)
    made = [
        (one.render(run, height_in=height_in), prefix + one.caption)
        for one in ALL_FIGURES
        if one.number in numbers
    ]
    return [drawing(figure, caption) for figure, caption in made if figure is not None]


def without_empty(rows: Sequence[tuple[str, str]]) -> Facts:
    return Facts([(name, value) for name, value in rows if value])


def in_unit(value: float | None, unit: Unit, decimals: int) -> str:
    """Write an SI value with its unit; "" for None."""
    return "" if value is None else typeset(unit.text(value, decimals)).replace(" ", NO_BREAK_SPACE)


def _stand(stand: Stand) -> Facts:
    geometry = ", ".join(
        f"{name.removesuffix('_m').replace('_', ' ')} {size:g} m" for name, size in stand.geometry.items()
    )
    mass_1 = format_value(stand.table_mass_kg, stand.table_mass_standard_uncertainty_kg, KILOGRAM.symbol)
    mass_2 = format_value(stand.plate_mass_kg, stand.plate_mass_standard_uncertainty_kg, KILOGRAM.symbol)
    gravity = format_value(
        stand.gravity_m_per_s2, stand.gravity_standard_uncertainty_m_per_s2, ACCELERATION.symbol
    )
    return without_empty(
        [
            ("name", stand.name),
            ("table mass m1", mass_1.in_print),
            ("plate mass m2", f"{mass_2.in_print} without added mass"),
            ("gravity", gravity.in_print),
            ("geometry", geometry),
        ]
    )


def _gain_uncertainty(gauge: Gauge) -> str:
    share = gauge.gain_relative_standard_uncertainty
    return NOT_STATED if share is None else f"{100.0 * share:.3g} %"


def _micrometres(length_m: float | None) -> str:
    return "" if length_m is None else typeset(f"{MICROMETRE.scale * length_m:.3g} {MICROMETRE.symbol}")


def _delay(gauge: Gauge) -> str:
    return f"{typeset(f'{gauge.delay_s * 1e6:.3g}')} ± {gauge.delay_standard_uncertainty_s * 1e6:.3g} µs"


_OF_GAUGE: Final = (
    ("serial number", lambda gauge: gauge.serial_number),
    ("gain", lambda gauge: f"{typeset(format_with_prefix(gauge.gain_m_per_count, 'm', 7))} per count"),
    ("its relative standard uncertainty", _gain_uncertainty),
    ("zero", lambda gauge: typeset(f"{gauge.zero_count:.9g} counts")),
    ("polynomial", lambda gauge: ", ".join(typeset(format_compact(term, 5)) for term in gauge.polynomial)),
    ("non-linearity", lambda gauge: _micrometres(gauge.nonlinearity_m)),
    ("hysteresis", lambda gauge: _micrometres(gauge.hysteresis_m)),
    ("repeatability", lambda gauge: _micrometres(gauge.repeatability_m)),
    ("delay", _delay),
    ("filter", lambda gauge: str(gauge.filter.description) if gauge.filter else ""),
    ("range", lambda gauge: (gauge.range_m and f"± {in_unit(gauge.range_m, MILLIMETRE, 2)}") or ""),
    ("reference", lambda gauge: gauge.reference),
    ("certificate", lambda gauge: gauge.certificate),
    ("calibrated by", lambda gauge: gauge.calibrated_by),
    ("calibrated on", lambda gauge: gauge.date.isoformat() if gauge.date else NOT_STATED),
    ("valid until", lambda gauge: gauge.valid_until.isoformat() if gauge.valid_until else NOT_STATED),
)
