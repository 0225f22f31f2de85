"""Origin of what many runs give together: a table, or a report."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from app.runs.analysis_request import quote_command
from app.runs.campaign.run_result import RunDetails
from app.runs.hashes import content_hash
from app.runs.metadata import RunSource
from app.runs.origin import (
    GAUGES,
    SIMULATED,
    Document,
    calibration_text,
    masses_text,
    program_document,
    request_text,
    software_text,
)


@dataclass(frozen=True, slots=True)
class CampaignOrigin:
    """Program, time and command of a table or a report, and the origin of each result in it."""

    program: Document = field(default_factory=dict)
    reproduce: str = ""
    """Command that gives the same digits as long as the runs stay as they are."""
    runs: Mapping[str, RunDetails] = field(default_factory=dict)
    """Those that count and whose results have an origin, by name."""

    @classmethod
    def of_runs(cls, runs: Mapping[str, RunDetails], reproduce: str) -> "CampaignOrigin":
        known = {name: details for name, details in runs.items() if details.origin}
        return cls(program_document(), reproduce, known)

    def source_of(self, names: Iterable[str]) -> str:
        """Where the samples of some runs come from; several sources in alphabetical order, with " + "."""
        return " + ".join(sorted({details.origin["source"] for details in self._some(names)}))

    def facts_of(self, names: Iterable[str]) -> dict[str, str]:
        """Origin of the results of some runs in columns."""
        origins = [details.origin for details in self._some(names)]
        return {
            "source": self.source_of(names),
            "program": _listed(map(software_text, origins)),
            "requests": _listed(one["request_hash"] for one in origins),
            "inputs_hash": _inputs(origins),
            "calibrations": _listed(
                f"{name} {gauge['identity']}"
                for one in origins
                for name, gauge in one["calibrations"].items()
            ),
            "masses": _listed(map(masses_text, origins)),
            "reproduce": self.reproduce,
        }

    def dated(self, date: str) -> "CampaignOrigin":
        """The same, of something that bears this date."""
        return replace(self, program=self.program and self.program | {"date": date})

    @property
    def warning(self) -> str:
        """Says that runs are simulated, where any is; else ""."""
        count = self._simulated_count
        if not count:
            return ""
        which = f"{count} of {len(self.runs)} runs are" if len(self.runs) > 1 else "the run is"
        return f"{SIMULATED}: {which} of a simulated stand, not of a real one."

    @property
    def mark(self) -> str:
        """Mark of each page: `SIMULATED`, with the count where only some runs are; "" where none is."""
        count, every = self._simulated_count, len(self.runs)
        return "" if not count else SIMULATED if count == every else f"{SIMULATED}: {count} of {every} runs"

    @property
    def _simulated_count(self) -> int:
        return sum(one.origin["source"] == RunSource.SIMULATED for one in self.runs.values())

    @property
    def inputs_hash(self) -> str:
        """Hash of requests and inputs of all results."""
        return _inputs([details.origin for details in self.runs.values()])

    def sentences(self) -> Iterator[str]:
        """The origin for people; nothing in it depends on when the results that are not kept were made."""
        if not self.program:
            return
        origins = [details.origin for details in self.runs.values()]
        yield f"Made by {software_text(self.program)}, {self.program['date']}"
        made = Counter((_kept_text(one), request_text(one.origin)) for one in self.runs.values())
        for (kept, request), count in made.items():
            yield f"{'1 result' if count == 1 else f'{count} results'} {kept}: {request}"
        for text, count in Counter(map(masses_text, origins)).items():
            yield f"{text}: {'1 run' if count == 1 else f'{count} runs'}"
        gauges = {
            f"{GAUGES[name]}: {calibration_text(gauge)}": None
            for one in origins
            for name, gauge in one["calibrations"].items()
        }
        yield from gauges
        yield f"Hash of all inputs: {_inputs(origins)}"
        yield f"Reproduce: {self.reproduce}"

    def document(self) -> Document:
        """As `table --json` gives it; calibrations stand once, by their identity."""
        calibrations: Document = {}
        runs = []
        for name, details in self.runs.items():
            of_run = details.origin["calibrations"]
            calibrations |= {gauge["identity"]: gauge for gauge in of_run.values()}
            identities = {gauge: stated["identity"] for gauge, stated in of_run.items()}
            kept = {"run": name, "analysis": details.analysis}
            runs.append(kept | details.origin | {"calibrations": identities})
        return self.program | {
            "source": self.source_of(self.runs),
            "inputs_hash": _inputs(runs),
            "reproduce": self.reproduce,
            "calibrations": calibrations,
            "runs": runs,
        }

    def _some(self, names: Iterable[str]) -> list[RunDetails]:
        return [self.runs[name] for name in names if name in self.runs]


def campaign_command(name: str, paths: Iterable[Path], words: Iterable[str] = ()) -> str:
    """Command `slipstand NAME` of runs and folders, from any folder."""
    absolute = (str(path.expanduser().absolute()) for path in paths)
    return quote_command(["slipstand", name, *absolute, *words])


def _inputs(origins: Iterable[Mapping[str, Any]]) -> str:
    """Hash of requests and inputs, whatever their order."""
    return content_hash(sorted((one["request_hash"], one["inputs_hash"]) for one in origins))


def _kept_text(details: RunDetails) -> str:
    """What made a result, and when, where it is kept in its run."""
    origin = details.origin
    if details.analysis is None:
        return "analysed for this, and not kept"
    return f"kept on {origin['date'][:10]} by {software_text(origin)}"


def _listed(texts: Iterable[str]) -> str:
    return " | ".join(dict.fromkeys(texts))
