"""What was found, in words and numbers for people: the result beside a recording and on Identify."""

import re
from dataclasses import dataclass, replace

from analysis.catalogue import CATALOGUE, MICROMETRE, Place, QuantityDefinition, definition
from analysis.formatting import typeset, with_unit
from analysis.identification import Degree, ModelSelection
from analysis.quantities import Quantity, ResultWarning
from analysis.verdict_text import EFFECT_TITLES, describe_verdict
from app.presenters import number_text
from app.presenters.analysed_run import AnalysedRun
from app.presenters.base import EMPTY_CHIP, Chip, Tone
from messages.i18n import N_, gettext, translate
from messages.message import Message


@dataclass(frozen=True, slots=True)
class ResultRow:
    """One quantity: symbol (rich text, subscripts as in the paper), the word for it, and the number."""

    symbol: str
    name: str
    value: str
    uncertainty: str = ""
    unit: str = ""

    @property
    def uncertainty_text(self) -> str:
        """What stands behind the value, smaller: `± 0.048 ms`."""
        return with_unit(f"± {self.uncertainty}" if self.uncertainty else "", self.unit).strip()


@dataclass(frozen=True, slots=True)
class Result:
    """A finished run as it is shown.

    `headline` is f_d, or what took its place; `comparison` holds the simulated stand's truth against it.
    """

    headline: ResultRow
    model_status: Chip
    rows: tuple[ResultRow, ...] = ()
    fit: str = ""
    comparison: str = ""
    end_status: Chip = EMPTY_CHIP
    warnings: tuple[str, ...] = ()
    about_stand: tuple[str, ...] = ()  # effects of the stand with their sizes and remedies
    path: str = ""


FRICTION = definition("friction_dynamic")
PLATE_FRICTION = definition("friction_dynamic_plate")
STATIC_LOWER = definition("friction_static_lower")
MAIN = (definition("period_s"), definition("damping_n1_per_s"))
_ALL = (FRICTION, *MAIN, *(row for row in CATALOGUE if not row.is_minor and row not in (FRICTION, *MAIN)))

_REMEDIES = {
    "clipped": N_("Check the gauge's range and zero."),
    "coarse-steps": N_("A finer range of the amplifier would help."),
    "friction-not-identified": N_("Pull further back, so that the plate slides."),
    "frozen": N_("Check the gauge's cable and amplifier."),
    "gauge-2-absolute": N_("Correct `measures` of gauge 2 in gauges.toml."),
    "gauge-2-dead": N_("Check the cable and the mounting of gauge 2."),
    "gauge-2-relative": N_("Correct `measures` of gauge 2 in gauges.toml."),
    "gauge-2-reversed": N_("Give its calibration a negative gain."),
    "mains-hum": N_("Check screens and grounding of the cables."),
    "masses-contradict-motion": N_("Check the masses of the run."),
    "model-inadequate": N_("Look for a pattern in the residual, and compare other laws."),
    "pullback-unlike-series": N_("Check the series of the run and the unit of the readings."),
    "released-twice": N_("Repeat the run if the release was not clean."),
    "spikes": N_("Check the cables for loose contacts."),
    "static-not-identified": N_("A longer pullback may make the plate stick and slip again."),
    "tail-too-short": N_("Record longer."),
    "tilt-not-identified": N_("Level the plane."),
    "zero-moved": N_("Let the amplifier warm up, or identify a run of the bare table."),
}
"""What to do about a warning whose own words do not say it."""

_MICROMETRES = re.compile(r" um\b")
_SENTENCE_ENDS = re.compile(r"(?<=[.!?])(?<!\be\.g\.)(?<!\bi\.e\.)(?<!\bno\.)(?<!\bvs\.) ")

_ENDINGS = {
    "rest": Chip(N_("Ended at rest"), Tone.OK),
    "enough": Chip(N_("Ended: more samples would not sharpen the result"), Tone.OK),
    "duration": Chip(N_("Ended after the set duration"), Tone.OK),
    "stopped": Chip(N_("Stopped by the operator"), Tone.WARN),
    "device-lost": Chip(N_("Ended early: the device was lost"), Tone.BAD),
    "stalled": Chip(N_("Ended early: samples stopped coming"), Tone.BAD),
    "trigger-timeout": Chip(N_("Ended: no release came in time"), Tone.WARN),
    "disk-full": Chip(N_("Ended early: the disk is full"), Tone.BAD),
    "write-error": Chip(N_("Ended early: the run could not be written further"), Tone.BAD),
    "interrupted": Chip(N_("Ended early: the recording was interrupted"), Tone.WARN),
}


def make_result(run: AnalysedRun, true_friction: float | None = None) -> Result:
    """Put an analysed run into words. `true_friction` is f_d of the simulated stand, if it is one."""
    return Result(
        headline=_headline(run),
        model_status=model_status(run.model, run.kind),
        rows=_rows(run, MAIN),
        fit=_fit(run),
        comparison=_comparison(run, true_friction),
        end_status=end_status(run.ended),
        warnings=tuple(_warning(warning) for warning in run.warnings if warning.code not in EFFECT_TITLES),
        about_stand=tuple(_warning(warning) for warning in run.warnings if warning.code in EFFECT_TITLES),
        path=str(run.path),
    )


def failed_result(message: Message | str, path: str, ended: str) -> Result:
    """Say of a stored run that nothing could be found in it, and why."""
    return Result(
        headline=ResultRow("", "", gettext("No result")),
        model_status=Chip(gettext("Nothing could be identified"), Tone.BAD),
        end_status=end_status(ended),
        warnings=(sentence(message),),
        path=path,
    )


def all_rows(run: AnalysedRun) -> tuple[ResultRow, ...]:
    rows = _rows(run, _ALL)
    degree = run.labels.get("msk64_degree")
    return (*rows, ResultRow("", gettext("MSK-64 degree"), str(degree))) if degree else rows


def make_row(row: QuantityDefinition, quantity: Quantity) -> ResultRow:
    shown = row.format(quantity, Place.WINDOW)
    return ResultRow(
        row.symbol.html, gettext(row.description), typeset(shown.value), shown.uncertainty, shown.unit
    )


def model_status(model: ModelSelection | None, kind: str) -> Chip:
    if model is None:
        return Chip(gettext("No motion to fit"), Tone.WARN)
    if model.adequate:
        hint = gettext("What the model leaves over is no more than the gauges' noise.")
        shown = gettext("Model fits, with effects of the stand") if model.parts else gettext("Model fits")
        return Chip(shown, Tone.OK, hint)
    if kind == "one-mass":
        return _one_mass_status(model)
    if model.degree is Degree.FRICTION:
        hint = gettext("The record holds more than the model explains, but two estimates of f_d agree.")
        return Chip(gettext("Model does not fit, but f_d holds"), Tone.WARN, hint)
    hint = gettext("The record holds more than the model explains: do not rely on the uncertainty of f_d.")
    return Chip(gettext("Model does not fit"), Tone.BAD, hint)


def _one_mass_status(model: ModelSelection) -> Chip:
    """Of a decay that the model does not explain."""
    if model.degree is Degree.FRICTION:
        hint = gettext("The record holds more than the model explains, but its halves agree on T and n.")
        return Chip(gettext("Model does not fit, but T and n hold"), Tone.WARN, hint)
    hint = gettext("The record holds more than the model explains: do not rely on T and n.")
    return Chip(gettext("Model does not fit"), Tone.BAD, hint)


def end_status(reason: str) -> Chip:
    known = _ENDINGS.get(reason)
    if known is None:
        return Chip(gettext("Ended: {reason}", reason=reason) if reason else "")
    return replace(known, text=gettext(known.text))


def sentence(message: Message | str) -> str:
    """Say a message in the window's language, each sentence of it with a capital letter.

    A path or a name at the beginning stays as it is.
    """
    return " ".join(_capital(part) for part in _SENTENCE_ENDS.split(translate(message)))


def in_words(message: Message | str) -> str:
    """A message of the analysis as a sentence, with micrometres as people write them."""
    return _MICROMETRES.sub("\u202fµm", sentence(message))


def format_micrometres(length_m: float) -> str:
    """Write a small length (m) as `21 µm`."""
    return number_text.format_in(MICROMETRE, length_m, 0 if length_m >= 10e-6 else 1)


def headline_key(run: AnalysedRun) -> str:
    """Name of the result that a run was made for, as far as it has one."""
    wanted = ("period_s",) if run.kind == "one-mass" else (FRICTION.name, STATIC_LOWER.name)
    return next((key for key in wanted if key in run.results), wanted[0])


def _capital(part: str) -> str:
    first_word = part.split(" ", 1)[0].rstrip(",")
    return part[:1].upper() + part[1:] if first_word.isalpha() else part


def _headline(run: AnalysedRun) -> ResultRow:
    shown = definition(headline_key(run))
    found = run.results.get(shown.name)
    return (
        ResultRow(shown.symbol.html, gettext(shown.description), gettext("not determined"))
        if found is None
        else make_row(shown, found)
    )


def _warning(warning: ResultWarning) -> str:
    """The words of the analysis, and what to do where they do not say it."""
    words, remedy = in_words(warning.message), gettext(_REMEDIES.get(warning.code, ""))
    return f"{words} {remedy}" if remedy else words


def _rows(run: AnalysedRun, shown: tuple[QuantityDefinition, ...]) -> tuple[ResultRow, ...]:
    return tuple(make_row(item, run.results[item.name]) for item in shown if item.name in run.results)


def _fit(run: AnalysedRun) -> str:
    model = run.model
    if model is None:
        return ""
    return gettext(
        "{verdict}; residual {residual}, noise {noise}",
        verdict=sentence(describe_verdict(model, run.kind)),
        residual=format_micrometres(model.residual_rms_m),
        noise=format_micrometres(model.noise_rms_m),
    )


def _comparison(run: AnalysedRun, true_friction: float | None) -> str:
    found = run.results.get(FRICTION.name)
    if not true_friction or found is None:
        return ""
    off_percent = round(100.0 * (found.value / true_friction - 1.0), 2) + 0.0
    off = with_unit(typeset(f"{off_percent:+.2f}"), "%")
    return gettext(
        "True value {truth}: found {off}", truth=number_text.format_fixed(true_friction, 5), off=off
    )
