"""The loss estimate from the host's clock counts lost samples and not late ones, on a busy computer too."""

from drivers.packets import LossEstimator

RATE_HZ = 1000.0


class Stream:
    """Reads of 10 ms each; some are late, and some samples are never sent."""

    def __init__(self) -> None:
        self.lateness = LossEstimator(RATE_HZ)
        self.now_s = 0.0
        self.lost = 0

    def go_on(self, duration_s: float, late_s: float = 0.0) -> None:
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self.now_s += 0.01
            samples = round((self.now_s - late_s) * RATE_HZ) - self.lost
            self.lateness.add(max(samples, 0), round(self.now_s * 1e9))


def test_what_is_lost_is_told_and_stays():
    stream = Stream()
    stream.go_on(5.0)
    assert stream.lateness.lost == 0
    stream.lost = 200
    stream.go_on(3.0)
    assert abs(stream.lateness.lost - 200) <= 1
    stream.go_on(20.0)
    assert abs(stream.lateness.lost - 200) <= 1


def test_what_comes_late_for_a_moment_is_not_lost():
    stream = Stream()
    for _ in range(5):
        stream.go_on(1.5)
        stream.go_on(0.5, late_s=0.4)
        assert stream.lateness.lost == 0


def test_a_computer_that_was_late_for_seconds_is_believed_only_beyond_that():
    """Late throughout for longer than the window: it looks like a loss until it comes after all."""
    stream = Stream()
    stream.go_on(3.0)
    stream.go_on(4.0, late_s=0.3)
    stream.go_on(4.0)
    assert stream.lateness.lost == 0
    stream.go_on(4.0, late_s=0.3)
    assert stream.lateness.lost == 0, "that is how this computer is"
    stream.go_on(3.0)
    stream.lost = 1000
    stream.go_on(4.0)
    assert abs(stream.lateness.lost - 1000) <= 1
