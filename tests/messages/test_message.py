import enum
import errno
import gettext
import pickle
from pathlib import Path

import msgspec
import numpy as np
import pytest

from messages.message import (
    Message,
    MessageError,
    joined,
    message,
    message_of,
    option,
    options_in,
    replace_options,
)


class Backwards(gettext.NullTranslations):
    """A language in which every word is read backwards; fields stay."""

    def gettext(self, text: str) -> str:
        return " ".join(word if "{" in word else word[::-1] for word in text.split(" "))

    def ngettext(self, one: str, many: str, count: int) -> str:
        return self.gettext(one if count == 1 else many)


class PortError(MessageError, ValueError):
    """An error as drivers have them."""


def test_str_is_the_english_sentence():
    assert (
        str(message("{port} is busy for {time_s:.1f} s", port="COM3", time_s=2)) == "COM3 is busy for 2.0 s"
    )


def test_braces_in_values_and_in_a_template_without_values_are_left_alone():
    assert str(message("{name} is unknown", name="{x}")) == "{x} is unknown"
    assert str(message("a set {of} braces")) == "a set {of} braces"


def test_nested_messages_and_lists_are_translated_with_the_message():
    gauge = message("gauge {number}", number=1)
    text = message("silent: {gauges}", gauges=[gauge, "gauge X"]).render(Backwards())
    assert text == ":tnelis eguag 1, gauge X"


def test_plural_is_chosen_by_count():
    files = [str(message("one file", plural="{count} files", count=count)) for count in (0, 1, 2)]
    assert files == ["0 files", "one file", "2 files"]


def test_joined_messages_are_translated_one_by_one():
    both = joined([message("Stop {now}.", now="here"), message("go on")])
    assert (str(both), both.render(Backwards())) == ("Stop here. go on", "potS here. og no")


@pytest.mark.parametrize("codec", [msgspec.json, msgspec.msgpack])
def test_messages_survive_being_sent(codec):
    sent = message("{a} {b} {c}", a=np.float64(0.5), b=[message("x {n}", n=np.int64(3)), "y"], c=None)
    assert codec.decode(codec.encode(sent), type=Message) == sent


def test_values_of_other_types_become_plain():
    class Side(enum.Enum):
        LEFT = "left"

    made = message("{side} {path}", side=Side.LEFT, path=Path("a") / "b.h5")
    assert made.values == {"side": "left", "path": str(Path("a") / "b.h5")}


def test_an_error_carries_its_message_through_pickle():
    error = PortError("{port} is busy", port="COM3")
    copy = pickle.loads(pickle.dumps(error))
    assert (str(copy), copy.message) == ("COM3 is busy", error.message)
    assert str(PortError(error.message)) == "COM3 is busy"


def test_message_of_any_error_is_one_line():
    assert str(message_of(OSError("no\nspace {left}"))) == "no space {left}"
    assert str(message_of(KeyError())) == "KeyError"
    assert message_of(PortError("busy")) == message("busy")


def test_an_empty_message_is_false_and_stays_empty_in_every_language():
    assert not message("")
    assert message("").render(Backwards()) == ""


def test_options_of_the_command_line_become_controls_of_a_window():
    remedy = message("add {option} {number}", option=option("--skip"), number=3)
    fault = message("{cell!r} is not a number: {remedy}", cell="--skip", remedy=remedy)
    assert str(fault) == "'--skip' is not a number: add --skip 3"
    assert options_in(pickle.loads(pickle.dumps(fault))) == ("--skip",)
    shown = replace_options(fault, {"--skip": message("Lines skipped")})
    assert str(shown) == "'--skip' is not a number: add Lines skipped 3"
    assert replace_options(fault, {}) == fault


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.EMFILE, "Too many open files"), "too many files are open: close other programs"),
        (OSError(errno.ENFILE, "Too many open files in system"), "too many files are open"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "too little memory left: close other programs"),
        (MemoryError(), "too little memory left: close other programs"),
    ],
)
def test_what_this_computer_lacks_is_told_with_the_remedy(error, said):
    assert said in str(message_of(error))
