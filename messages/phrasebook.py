"""Messages of the layers below in another language: which template a message was made from.

Those layers speak English and know of no other language. A message is recognised by its fixed words:
`the disk has {0} left` fits `the disk has 3 GB left`, and what stands in the hole is put into the
translation, itself translated where it is made from a template too.
"""

import re
import string
from collections.abc import Iterable, Mapping
from functools import cache, cached_property, lru_cache
from gettext import translation
from pathlib import Path

_FRAGMENTS = (
    "gauge 1", "gauge 2", "gauge 1 (table)", "gauge 2 (relative)", "table", "plate", "relative", "earlier",
    "later", "forward", "back", "and", "pullback", "velocity", "contact", "plate mass", "table mass",
)  # fmt: skip
_ENTRY = re.compile(r'^(msgid_plural|msgid|msgstr)(?:\[(\d)\])? "(.*)"$')
_SENTENCE_END = re.compile(r"(?<=[.!?]) (?=[A-Z])")
_JOINTS = re.compile(r": |; |, | and ")
_SIDE_BY_SIDE = re.compile(r"\} \{")
_LONG_WORD = re.compile(r"\b[a-z]{3,}\b")
_LITTLE = 10
"""Characters of fixed words."""
_LONGEST = 2000
"""Characters; what is longer is a log rather than a message."""


class _Template:
    """A translated template; `hole` is the expression of what may stand in its holes.

    `fixed` is its longest piece of fixed words, which a message must hold to be worth a closer look.
    """

    def __init__(self, text: str, said: str, hole: str) -> None:
        self.said = said
        self._parsed = [(literal, name is not None) for literal, name, _, _ in _parse(text)]
        self._hole = hole
        literals = [literal for literal, _ in self._parsed]
        self.fixed = max(literals, key=len)
        self.weight = sum(map(len, literals))

    @cached_property
    def pattern(self) -> re.Pattern[str]:
        """Made when it is first needed: most templates never are."""
        made = (re.escape(literal) + self._hole * has_hole for literal, has_hole in self._parsed)
        return re.compile("".join(made), re.DOTALL)

    def takes(self, hole: str) -> bool:
        """Tell whether a value can have been put into a hole, so that the message is this one.

        A hole that holds the fixed words again swallowed a second message. `{0} to {1} mm` fits many a
        sentence: where so little is fixed, values are numbers and symbols.
        """
        return self.fixed not in hole and not (self.weight < _LITTLE and _LONG_WORD.search(hole))


class Phrasebook:
    """Translates messages.

    Parameters
    ----------
    messages : mapping of str to str
        Translations by template; holes are `{0}`, `{1}`, ... in both.
    words : mapping of str to str
        Translations of single words that stand in holes.
    """

    def __init__(self, messages: Mapping[str, str], words: Mapping[str, str]) -> None:
        whole = {one: said for one, said in messages.items() if not _has_holes(one)}
        self._words = {**words, **{one.format(): said.format() for one, said in whole.items()}}
        # Of `gauge 2 stands still` in two holes, one holds `gauge 2`: what is known comes first.
        hole, side_by_side = _hole(words), _hole(self._words)
        templates = [
            _Template(one, said, side_by_side if _SIDE_BY_SIDE.search(one) else hole)
            for one, said in messages.items()
            if one not in whole
        ]
        # The one with most fixed words is the one that is meant.
        self._templates = sorted(templates, key=lambda template: -template.weight)
        self.said = lru_cache(maxsize=1024)(self._said)

    def _said(self, message: str) -> str:
        """Translate a message; one that fits no template stays as it is."""
        return (self._whole(message) or self._in_parts(message)) if len(message) <= _LONGEST else message

    def _whole(self, message: str) -> str:
        """Translation of a message that is one template; empty if it is none."""
        found = self._fitting(message)
        if not found and message[:1].isupper():
            found = _capital(self._whole(message[0].lower() + message[1:]))
        if not found and message.endswith("."):
            found = self._fitting(message[:-1])
            found = found and f"{found}."
        return found

    def _fitting(self, message: str) -> str:
        if message in self._words:
            return self._words[message]
        for template in self._templates:
            fit = template.pattern.fullmatch(message) if template.fixed in message else None
            if fit and all(template.takes(hole) for hole in fit.groups()):
                return template.said.format(*map(self.said, fit.groups()))
        return ""

    def _in_parts(self, message: str) -> str:
        """Translate several messages in a row, or what stands on both sides of a joint as after a path."""
        if said := self._at(_SENTENCE_END, message):
            return said
        sentences = _SENTENCE_END.split(message)
        return (
            " ".join(map(self.said, sentences))
            if len(sentences) > 1
            else self._at(_JOINTS, message) or message
        )

    def _at(self, joints: re.Pattern[str], message: str) -> str:
        """Translate both sides of the first joint beside which a side is known; empty if none is."""
        sides = [
            (self._whole(message[: joint.start()]), joint, self._whole(message[joint.end() :]))
            for joint in joints.finditer(message)
        ]
        for head, joint, _ in sides:  # of what goes on with a comma, the comma is part
            if head and (tail := self._whole(message[joint.start() :])).startswith(","):
                return f"{head}{tail}"
        # Best where both sides are known, as of a list; else one is a path or a name.
        for head, joint, tail in sorted(sides, key=lambda side: not (side[0] and side[2])):
            if head or tail:
                left = head or self.said(message[: joint.start()])
                right = tail or self.said(message[joint.end() :])
                return left + self._joint(joint[0]) + right
        return ""

    def _joint(self, text: str) -> str:
        word = text.strip()
        return text.replace(word, self._words.get(word, word))


_parse = string.Formatter().parse


def _has_holes(template: str) -> bool:
    return any(name is not None for _, name, _, _ in _parse(template))


def _hole(known: Iterable[str]) -> str:
    return "(" + "".join(f"{re.escape(word)}|" for word in sorted(known, key=len, reverse=True)) + ".*?)"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def translate_sentence(sentence: str, language: str) -> str:
    """Translate an English sentence by the template that it was made from."""
    return _phrasebook(language).said(sentence)


@cache
def _phrasebook(language: str) -> Phrasebook:
    locale = Path(__file__).parent / "locale"
    path = locale / "messages" / f"{language}.po"
    messages = parse_po(path.read_text(encoding="utf-8") if path.exists() else "")
    words = translation("slipstand", locale, [language], fallback=True)
    return Phrasebook(
        {one: forms[0] for one, forms in messages.items() if any(forms)},
        {one: words.gettext(one) for one in _FRAGMENTS},
    )


def parse_po(text: str) -> dict[str, tuple[str, ...]]:
    """Read a PO file: translations by English text."""
    texts: dict[str, tuple[str, ...]] = {}
    for block in re.split(r"\n\s*\n", text):
        one, forms = _entry(block)
        if one:
            texts[one] = forms
    return texts


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
