"""What the guidance depends on, gathered from the engine, the gauges, and the stand as it is set up."""

from app.acquisition.messages import PullbackState
from app.acquisition.pullback.plan import AllowedPlateRange
from app.presenters.base import Chip, Tone
from app.presenters.record.bench import Bench
from app.presenters.record.course import Course
from app.presenters.record.guidance import Situation
from app.presenters.record.live import LiveTraces
from app.presenters.results import sentence


def situation_of(course: Course, bench: Bench, live: LiveTraces, series: str) -> Situation:
    """Put together where the test stands; `series` is that of the next run."""
    gauge = bench.gauges.relative
    table_m, relative_m = (float(value) for value in live.newest_m() + live.zero_m)
    return Situation(
        where=course.where,
        standing=course.standing,
        table_m=table_m,
        plate_m=relative_m + table_m if gauge.measures == "plate" else relative_m,
        room=bench.room(series),
        simulated=course.simulated,
        note="" if course.is_idle else course.note,
        waiting_for=course.waiting_for,
        lost=course.lost,
    )


def news_of(course: Course, said: Chip) -> Chip:
    """Add to what was `said` what the engine notes while nothing is recorded: it is no instruction then."""
    if not (course.is_idle and course.note):
        return said
    tone = Tone.BAD if said.tone is Tone.BAD else Tone.WARN
    parts = (said.text.rstrip("."), sentence(course.note))
    return Chip(". ".join(filter(None, parts)), tone, said.hint)


def shown_room(course: Course, bench: Bench, series: str) -> AllowedPlateRange | None:
    """Where the plate may stand, while it has to be put back and gauge 2 can show where."""
    measures_it = bench.gauges.relative.measures == "relative"
    has_to = course.engine is PullbackState.RECENTRE
    return bench.room(series) if measures_it and has_to else None
