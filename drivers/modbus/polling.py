"""Which requests bring one sample, and where in their answers its readings stand."""

from dataclasses import dataclass

from drivers.modbus.frames import MAX_REGISTERS, Function, Request
from drivers.modbus.registers import Channel, ChannelValue, decode_channel


@dataclass(frozen=True, slots=True)
class RegisterLocation:
    """Where registers stand: in the answer to which request, and at which byte."""

    request: int
    start: int


@dataclass(frozen=True, slots=True)
class Poll:
    """One sample of all channels.

    Attributes
    ----------
    requests : tuple of Request
        In the order in which they are made: one where all registers are side by side in one unit. The
        first one's time is the sample's.
    channels : tuple of Channel
    values, states : tuple of Place
        Of each channel's reading, and of its status register (None where it has none).
    """

    requests: tuple[Request, ...]
    channels: tuple[Channel, ...]
    values: tuple[RegisterLocation, ...]
    states: tuple[RegisterLocation | None, ...]

    def channel_values(self, answers: list[bytes]) -> list[ChannelValue]:
        """What the registers of all answers say, channel by channel."""
        return [
            decode_channel(
                channel, self._bytes(answers, value, channel.registers), self._word(answers, state)
            )
            for channel, value, state in zip(self.channels, self.values, self.states, strict=True)
        ]

    def _word(self, answers: list[bytes], place: RegisterLocation | None) -> int:
        return 0 if place is None else int.from_bytes(self._bytes(answers, place, 1), "big")

    @staticmethod
    def _bytes(answers: list[bytes], place: RegisterLocation, registers: int) -> bytes:
        return answers[place.request][place.start : place.start + 2 * registers]


def plan_poll(channels: tuple[Channel, ...]) -> Poll:
    """The fewest requests that read nothing but what is needed."""
    spans: dict[tuple[int, Function], list[tuple[int, int]]] = {}
    for channel in channels:
        spans.setdefault((channel.unit, channel.function), []).extend(_spans(channel))
    requests = tuple(
        Request(unit, function, first, end - first)
        for (unit, function), parts in spans.items()
        for first, end in _merge_spans(parts)
    )
    return Poll(
        requests=requests,
        channels=channels,
        values=tuple(_find(requests, channel, channel.register) for channel in channels),
        states=tuple(
            None if channel.status is None else _find(requests, channel, channel.status.register)
            for channel in channels
        ),
    )


def _spans(channel: Channel) -> list[tuple[int, int]]:
    """Registers that a channel needs, as (first, end)."""
    spans = [(channel.register, channel.register + channel.registers)]
    if channel.status is not None:
        spans.append((channel.status.register, channel.status.register + 1))
    return spans


def _merge_spans(spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Spans that touch or overlap as one, as long as one request may read it."""
    joined: list[tuple[int, int]] = []
    for first, end in sorted(spans):
        if joined and first <= joined[-1][1] and end - joined[-1][0] <= MAX_REGISTERS:
            joined[-1] = (joined[-1][0], max(end, joined[-1][1]))
        else:
            joined.append((first, end))
    return joined


def _find(requests: tuple[Request, ...], channel: Channel, register: int) -> RegisterLocation:
    for i, request in enumerate(requests):
        holds = request.register <= register < request.register + request.count
        if holds and (request.unit, request.function) == (channel.unit, channel.function):
            return RegisterLocation(i, 2 * (register - request.register))
    raise LookupError(f"register {register} is in no request")
