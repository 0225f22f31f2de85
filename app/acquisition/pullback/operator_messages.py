"""Messages to the operator: hints during the wait, remarks on a release, and the end of the wait."""

from app.acquisition.messages import PullbackState
from app.acquisition.pullback.plan import PullbackPlan
from messages.message import EMPTY, Message, message

NOT_HELD_NOTE = message(
    "The table came back without being held still. Pull back again and hold it for a moment"
)
ALREADY_PULLED_NOTE = message(
    "The table was already pulled back when armed, so its zero before the pull is not known"
)
NOT_RECENTRED_NOTE = message(
    "The plate was not pushed back before the pull: its slip may leave the range of gauge 2"
)
RESTLESS_NOTE = message("The table has not come to rest yet, so its zero cannot be taken. Still it")
NO_READING_NOTE = message("Gauge 1 gives no reading. Check its cable, and whether it is overloaded")


_TIMEOUT_CAUSES = {
    PullbackState.RECENTRE: message(
        "the plate was not pushed back. Push it to where the next slip fits gauge 2"
    ),
    PullbackState.ZERO: message(
        "the table never came to rest, or gauge 1 gave no reading. Still it, check the gauge"
    ),
    PullbackState.PULLING: message(
        "the table was never held at the pullback. Pull back, hold still, let go at once"
    ),
    PullbackState.HELD: message(
        "the table was held, but never steadily. Hold it without drift and let go at once"
    ),
    PullbackState.ARMED: message("the table was held and never let go. Let go at once when armed"),
}


def timeout_note(state: PullbackState, timeout_s: float) -> Message:
    """Reason why a run ended without a release, by the state in which it waited."""
    return message(
        "no release within {timeout_s:g} s: {cause}", timeout_s=timeout_s, cause=_TIMEOUT_CAUSES[state]
    )


def off_target_note(pulled_m: float, wanted_m: float) -> Message:
    """Remark on a release from another pullback than the planned one (m, without sign)."""
    return message(
        "Released from {pulled_mm:.2f} mm instead of {planned_mm:g} mm",
        pulled_mm=1e3 * pulled_m,
        planned_mm=1e3 * wanted_m,
    )


def not_steady_note(held_s: float) -> Message:
    """Remark on a release that came before the hold was steady enough to be armed."""
    return message(
        "Released before it was armed, {held_s:.1f} s after the pull. Hold still until it says armed",
        held_s=held_s,
    )


def no_room_note(plan: PullbackPlan) -> Message:
    """Remark on a gauge 2 whose range is too short for the slip, wherever the plate stands; else empty."""
    if plan.plate_range is None or plan.plate_range.exists:
        return EMPTY
    return message(
        "The slip may leave the range of gauge 2 (±{range_mm:g} mm) wherever the plate stands",
        range_mm=1e3 * (plan.relative_range_m or 0.0),
    )


def drift_hint(drift_m_per_s: float) -> Message:
    """Instruction for a hold that drifts."""
    return message(
        "The table drifts by {drift_mm_per_s:.2f} mm/s. Hold it still",
        drift_mm_per_s=1e3 * abs(drift_m_per_s),
    )


def filling_hint(pretrigger_s: float) -> Message:
    """Instruction while the stream is younger than the pretrigger."""
    return message(
        "The {pretrigger_s:g} s that are kept from before the release are not there yet. Go on holding",
        pretrigger_s=pretrigger_s,
    )


def timeout_warning(left_s: float) -> Message:
    """Warn that the wait for a release will be over soon."""
    return message("No release yet: the run ends without one in {left_s:g} s", left_s=left_s)
