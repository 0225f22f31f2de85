"""What is said while a release is waited for: hints, remarks about how it came, and the end of patience."""

from app.acquisition.messages import PullbackState
from app.acquisition.pullback.plan import PullbackPlan

NOT_HELD_NOTE = "The table came back without being held still. Pull back again and hold it for a moment"
ALREADY_PULLED_NOTE = "The table was already pulled back when armed, so its zero before the pull is not known"
NOT_RECENTRED_NOTE = "The plate was not pushed back before the pull: its slip may leave the range of gauge 2"
RESTLESS_NOTE = "The table has not come to rest yet, so its zero cannot be taken. Still it"
NO_READING_NOTE = "Gauge 1 gives no reading. Check its cable, and whether it is overloaded"

HINT_AFTER_S = 2.0
_LAST_CALL_S = 60.0
_SILENT_S = 0.5

_ENDINGS = {
    PullbackState.RECENTRE: "the plate was not pushed back. Push it to where the next slip fits gauge 2",
    PullbackState.ZERO: "the table never came to rest, or gauge 1 gave no reading. Still it, check the gauge",
    PullbackState.PULLING: "the table was never held at the pullback. Pull back, hold still, let go at once",
    PullbackState.HELD: "the table was held, but never steadily. Hold it without drift and let go at once",
    PullbackState.ARMED: "the table was held and never let go. Let go at once when armed",
}


def timeout_note(state: PullbackState, timeout_s: float) -> str:
    """Why a run ended without a release, by the state that it waited in; the last seconds are kept."""
    return f"no release within {timeout_s:g} s: {_ENDINGS[state]}"


def off_target_note(pulled_m: float, wanted_m: float) -> str:
    """What there is to say of a release from another pullback than wanted (m, without sign)."""
    return f"Released from {1e3 * pulled_m:.2f} mm instead of {1e3 * wanted_m:g} mm"


def not_steady_note(held_s: float) -> str:
    """What there is to say of a release that came before the hold was steady enough to be armed."""
    return f"Released before it was armed, {held_s:.1f} s after the pull. Hold still until it says armed"


def no_room_note(plan: PullbackPlan) -> str:
    """What there is to say of a gauge 2 whose range is too short for any place of the plate; else empty."""
    if plan.plate_range is None or plan.plate_range.exists:
        return ""
    range_mm = 1e3 * (plan.relative_range_m or 0.0)
    return f"The slip may leave the range of gauge 2 (±{range_mm:g} mm) wherever the plate stands"


def drift_hint(drift_m_per_s: float) -> str:
    """What to do about a hold that drifts."""
    return f"The table drifts by {1e3 * abs(drift_m_per_s):.2f} mm/s. Hold it still"


def filling_hint(pretrigger_s: float) -> str:
    """What to do while the stream is younger than the pretrigger."""
    return f"The {pretrigger_s:g} s that are kept from before the release are not there yet. Go on holding"


class ReleaseTimeout:
    """How long a release is waited for.

    Parameters
    ----------
    plan : PullbackPlan
    armed_index : int
        Sample from which on the time counts.
    """

    def __init__(self, plan: PullbackPlan, armed_index: int) -> None:
        self._rate_hz = plan.rate_hz
        self._timeout_s = plan.trigger_timeout_s
        self._armed_index = armed_index
        self._last_call_s = min(_LAST_CALL_S, 0.5 * plan.trigger_timeout_s)

    @property
    def end_index(self) -> float:
        """Sample at which it is over."""
        return self._armed_index + self._timeout_s * self._rate_hz

    def warning(self, now: float) -> str:
        """Say once in time that it will be over soon; empty before that."""
        if now < self.end_index - self._last_call_s * self._rate_hz:
            return ""
        return f"No release yet: the run ends without one in {self._last_call_s:g} s"

    def is_silent(self, last_reading: float, now: float) -> bool:
        """Tell whether gauge 1 has given nothing for too long."""
        return now - last_reading > _SILENT_S * self._rate_hz
