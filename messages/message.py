"""Messages as data: an English template and the values in it.

Errors, warnings and engine notes carry a `Message`. `str()` of it is the English sentence. Another language
is a look-up of the template (`messages.i18n`); no code reads a sentence.
"""

import enum
import errno
from collections.abc import Mapping, Sequence
from gettext import NullTranslations
from pathlib import PurePath
from typing import SupportsFloat, TypeAlias, Union, cast

import msgspec

Plain: TypeAlias = str | int | float | bool | None
# msgspec evaluates the annotation: a forward reference needs Union.
Value: TypeAlias = Union[Plain, "Message", list[Union[Plain, "Message"]]]

_ENGLISH = NullTranslations()


class Message(msgspec.Struct, frozen=True):
    """A sentence, or a part of one, as template and values.

    Build it with `message`, which converts values.
    """

    template: str  # english, with fields in braces: "{port} is busy". It is the key of its translations.
    values: dict[str, Value] = {}
    """By field name. A `Message` is rendered in the same language. A list is joined with ", "."""
    plural: str = ""  # template where `values["count"]` is not 1; "" where the message counts nothing

    def __str__(self) -> str:
        return self.render()

    def __bool__(self) -> bool:
        return bool(self.template)

    def __hash__(self) -> int:
        # Values may be lists.
        return hash((self.template, self.plural))

    def render(self, translations: NullTranslations = _ENGLISH) -> str:
        """Render the sentence in the language of `translations`; English by default."""
        if not self.template:
            return ""
        if self.plural:
            template = translations.ngettext(self.template, self.plural, cast(int, self.values["count"]))
        else:
            template = translations.gettext(self.template)
        values = {name: _rendered(value, translations) for name, value in self.values.items()}
        return template.format(**values) if values else template


class Option(Message, frozen=True):
    """An option of the command line in a message; a window names its control instead (`replace_options`)."""


EMPTY = Message("")  # nothing to say; false in a condition


class MessageError(Exception):
    """Root of errors whose text is a `Message`: one that exists, or template, plural and values of one."""

    def __init__(self, template: str | Message, /, *, plural: str = "", **values: object) -> None:
        made = template if isinstance(template, Message) else message(template, plural=plural, **values)
        super().__init__(made)  # as the only argument, so that the error can be pickled

    @property
    def message(self) -> Message:
        return cast(Message, self.args[0])


def message(template: str, /, *, plural: str = "", **values: object) -> Message:
    """Build a message. Numbers of NumPy become Python's; enum members their values; all else becomes text."""
    return Message(template, {name: _value(value) for name, value in values.items()}, plural)


def option(name: str) -> Option:
    """Name an option of the command line, such as `--skip`, as value of a message."""
    return Option(name)


def options_in(text: Message) -> tuple[str, ...]:
    """Names of the options that a message names, in their order."""
    names: list[str] = []
    for value in text.values.values():
        if isinstance(value, Option):
            names.append(value.template)
        elif isinstance(value, Message):
            names += options_in(value)
    return tuple(names)


def replace_options(text: Message, labels: Mapping[str, Message]) -> Message:
    """Replace options by the labels of a window's controls; options without a label stay."""
    values: dict[str, Value] = dict(text.values)
    for name, value in text.values.items():
        if isinstance(value, Option):
            values[name] = labels.get(value.template, value)
        elif isinstance(value, Message):
            values[name] = replace_options(value, labels)
    return Message(text.template, values, text.plural)


def joined(parts: Sequence[Message | str], separator: str = " ") -> Message:
    """Join messages into one, each translated by itself, as sentences of a paragraph."""
    named: dict[str, Value] = {f"part_{number}": part for number, part in enumerate(parts)}
    fields = (f"{{{name}}}" for name in named)
    return Message(separator.replace("{", "{{").replace("}", "}}").join(fields), named)


def as_message(text: Message | str) -> Message:
    """Return a text as message; a message as it is."""
    return text if isinstance(text, Message) else message("{text}", text=text) if text else EMPTY


def message_of(error: BaseException) -> Message:
    """Message of an error; of errors that carry none, or one of several lines, their text on one line."""
    if isinstance(error, MessageError) and "\n" not in str(error):
        return error.message
    if lacking := lacking_resource(error):
        return lacking
    return message("{text}", text=" ".join(str(error).split()) or type(error).__name__)


_OPEN_FILES = (errno.EMFILE, errno.ENFILE)


def lacking_resource(error: BaseException) -> Message:
    """Message of an error for which this computer, and no file, is to blame; EMPTY for any other."""
    number = getattr(error, "errno", None)
    if number in _OPEN_FILES:
        return message(
            "too many files are open: close other programs, or allow more open files (ulimit -n 256)"
        )
    if number == errno.ENOMEM or isinstance(error, MemoryError):
        return message("this computer has too little memory left: close other programs")
    return EMPTY


def _value(value: object) -> Value:
    if isinstance(value, enum.Enum):
        value = value.value
    if isinstance(value, MessageError):
        return value.message
    if value is None or type(value) in (str, int, float, bool) or isinstance(value, Message):
        return cast(Value, value)
    if isinstance(value, (list, tuple)):
        return [cast("Plain | Message", _value(part)) for part in value]
    if isinstance(value, str | PurePath):
        return str(value)
    if hasattr(value, "item") and isinstance(value, SupportsFloat):  # a NumPy number
        return cast("int | float | bool", value.item())  # type: ignore[attr-defined]
    return str(value)


def _rendered(value: Value, translations: NullTranslations) -> Plain:
    if isinstance(value, Message):
        return value.render(translations)
    if isinstance(value, list):
        return ", ".join(str(_rendered(part, translations)) for part in value)
    return value
