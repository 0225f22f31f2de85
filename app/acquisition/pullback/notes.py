"""Notes to the operator of a pullback test: what is not as expected, and what to do about it."""

from typing import NamedTuple

from app.acquisition.messages import PullbackState
from messages.message import Message, message


class OperatorNote(NamedTuple):
    """What is not as expected, and what the operator does about it."""

    fact: Message
    remedy: Message


NOT_HELD_NOTE = OperatorNote(
    message("The table came back without being held still"),
    message("Pull back again and hold it for a moment"),
)
ALREADY_PULLED_NOTE = message(
    "The table was already pulled back when armed, so its zero before the pull is not known"
)
NOT_RECENTRED_NOTE = message(
    "The plate was not pushed back before the pull: its slip may leave the range of gauge 2"
)
RESTLESS_NOTE = OperatorNote(
    message("The table has not come to rest yet, so its zero cannot be taken"), message("Still it")
)
NO_READING_NOTE = OperatorNote(
    message("Gauge 1 gives no reading"), message("Check its cable, and whether it is overloaded")
)
TIMEOUT_CAUSES = {
    PullbackState.RECENTRE: OperatorNote(
        message("the plate was not pushed back"), message("Push it to where the next slip fits gauge 2")
    ),
    PullbackState.ZERO: OperatorNote(
        message("the table never came to rest, or gauge 1 gave no reading"),
        message("Still it, check the gauge"),
    ),
    PullbackState.PULLING: OperatorNote(
        message("the table was never held at the pullback"),
        message("Pull back, hold still, let go at once"),
    ),
    PullbackState.HELD: OperatorNote(
        message("the table was held, but never steadily"), message("Hold it without drift and let go at once")
    ),
    PullbackState.ARMED: OperatorNote(
        message("the table was held and never let go"), message("Let go at once when armed")
    ),
}
LET_DOWN_NOTE = OperatorNote(
    message("The table was let down, not released"),
    message("Pull back again, hold still, and let go at once"),
)
NO_SLIP_NOTE = OperatorNote(
    message("The plate did not slip: the run gives T, n1 and a lower bound of f_s"),
    message("Pull further for f_d"),
)
SILENT_PLATE_NOTE = OperatorNote(
    message("Gauge 2 gives no reading, so it is unknown whether the plate slips"),
    message("Check its cable"),
)
