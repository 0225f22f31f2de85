"""The language of the window: English as written in the source, or a catalogue of `messages/locale`.

`SLIPSTAND_LANGUAGE` says which; it is inherited by the processes that the window starts. Drivers, files
and analysis say everything in English, as on the command line and in logs: the window retells it by the
templates of `messages/locale/messages`.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from gettext import c2py
from importlib.resources import files
from pathlib import Path

from messages.phrasebook import Phrasebook

LANGUAGE_VARIABLE = "SLIPSTAND_LANGUAGE"
ENGLISH = "en"
_ENTRY = re.compile(r'^(msgid_plural|msgid|msgstr)(?:\[(\d)\])? "(.*)"$')
_PLURAL = re.compile(r"plural=([^;]+);")


@dataclass(frozen=True, slots=True)
class Catalogue:
    """A translation.

    Attributes
    ----------
    texts : dict of str to tuple of str
        By the English text (of one, where it counts something), the translation or its plural forms.
    form : callable
        Which of the plural forms goes with a number.
    """

    texts: dict[str, tuple[str, ...]]
    form: Callable[[int], int]


def gettext(text: str, /, **values: object) -> str:
    """Translate a text, and put values into its `{braces}`. What has no translation stays English."""
    found = _in_use().texts.get(text, ("",))[0] or text
    return found.format(**values) if values else found


def ngettext(one: str, many: str, count: int, /, **values: object) -> str:
    """Translate a text that counts something; `{count}` in it is the number."""
    catalogue = _in_use()
    forms = catalogue.texts.get(one, ())
    found = forms[catalogue.form(count)] if len(forms) > 1 else ""
    return (found or (one if count == 1 else many)).format(count=count, **values)


def N_(text: str) -> str:  # noqa: N802 - the name that gettext recommends
    """Mark a text for translation that is only translated where it is shown, as in a table of names."""
    return text


def translate_message(message: str) -> str:
    """Say a message of drivers, files or analysis in the window's language; unknown ones stay English."""
    language = os.environ.get(LANGUAGE_VARIABLE, ENGLISH)
    return message if language == ENGLISH else _phrasebook(language).said(message)


FRAGMENTS = (
    N_("gauge 1"), N_("gauge 2"), N_("gauge 1 (table)"), N_("gauge 2 (relative)"), N_("table"),
    N_("plate"), N_("relative"), N_("earlier"), N_("later"), N_("forward"), N_("back"),
    N_("and"), N_("pullback"), N_("velocity"), N_("contact"), N_("plate mass"), N_("table mass"),
)  # fmt: skip
"""Words too short for a template, which stand in the holes of messages."""


def languages() -> tuple[str, ...]:
    """Languages that there are, English first."""
    return (ENGLISH, *sorted(path.stem for path in _folder().glob("*.po")))


def parse_po(text: str) -> Catalogue:
    """Read a PO file: entries of `msgid`, `msgid_plural`, `msgstr`, comments aside; no contexts."""
    texts: dict[str, tuple[str, ...]] = {}
    for block in re.split(r"\n\s*\n", text):
        one, forms = _entry(block)
        if one is not None:
            texts[one] = forms
    header = texts.pop("", ("",))[0]
    plural = _PLURAL.search(header)
    return Catalogue(texts, c2py(plural[1] if plural else "n != 1"))


def _entry(block: str) -> tuple[str | None, tuple[str, ...]]:
    """English text and translations of one entry; continued lines belong to the line before."""
    fields: dict[tuple[str, str], str] = {}
    key = ("", "")
    for line in block.splitlines():
        if found := _ENTRY.match(line):
            key = (found[1], found[2] or "")
            fields[key] = _plain(found[3])
        elif line.startswith('"') and key in fields:
            fields[key] += _plain(line[1:-1])
    forms = tuple(fields[name] for name in sorted(fields) if name[0] == "msgstr")
    return fields.get(("msgid", "")), forms


def _plain(quoted: str) -> str:
    return re.sub(r"\\(.)", lambda found: {"n": "\n"}.get(found[1], found[1]), quoted)


def _in_use() -> Catalogue:
    return _load(os.environ.get(LANGUAGE_VARIABLE, ENGLISH))


@cache
def _load(language: str) -> Catalogue:
    path = _folder() / f"{language}.po"
    known = language in languages()
    return parse_po(path.read_text(encoding="utf-8") if known and language != ENGLISH else "")


@cache
def _phrasebook(language: str) -> Phrasebook:
    path = _folder() / "messages" / f"{language}.po"
    known = language in languages() and path.exists()
    messages = parse_po(path.read_text(encoding="utf-8") if known else "").texts
    words = _load(language).texts
    return Phrasebook(
        {one: forms[0] for one, forms in messages.items() if any(forms)},
        {one: words[one][0] for one in FRAGMENTS if any(words.get(one, ()))},
    )


def _folder() -> Path:
    return Path(str(files("messages"))) / "locale"
