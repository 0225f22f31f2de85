"""Messages of the layers below in another language: which template a message was made from.

Those layers speak English and know of no other language. A message is recognised by its fixed words:
`the disk has {0} left` fits `the disk has 3 GB left`, and what stands in the hole is put into the
translation, itself translated where it is made from a template too.
"""

import re
import string
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

_SENTENCE_END = re.compile(r"(?<=[.!?]) (?=[A-Z])")
_JOINTS = re.compile(r": |; |, | and ")
_LONGEST = 2000
"""Characters; what is longer is a log rather than a message."""


@dataclass(frozen=True, slots=True)
class _Template:
    """A translated template.

    `fixed` is its longest piece of fixed words, which a message must hold to be worth a closer look.
    """

    pattern: re.Pattern[str]
    fixed: str
    said: str


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
        self._words = dict(words)
        # Words that are known come first: of `gauge 2 stands still` in two holes, one holds `gauge 2`.
        known = "".join(f"{re.escape(word)}|" for word in sorted(words, key=len, reverse=True))
        hole = f"({known}.*?)"
        templates: list[tuple[int, _Template]] = []
        for one, said in messages.items():
            pieces = [literal for literal, _, _, _ in string.Formatter().parse(one)]
            if _has_holes(one):
                fixed = max(pieces, key=len)
                template = _Template(re.compile(_pattern(one, hole), re.DOTALL), fixed, said)
                templates.append((sum(map(len, pieces)), template))
            else:
                self._words["".join(pieces)] = said.format()
        # The one with most fixed words is the one that is meant.
        self._templates = [template for _, template in sorted(templates, key=lambda one: -one[0])]
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
            # A hole that holds the fixed words again swallowed a second message.
            if fit and not any(template.fixed in hole for hole in fit.groups()):
                return template.said.format(*map(self.said, fit.groups()))
        return ""

    def _in_parts(self, message: str) -> str:
        """Translate sentence by sentence, or what stands on both sides of a joint as after a path."""
        sentences = _SENTENCE_END.split(message)
        if len(sentences) > 1:
            return " ".join(map(self.said, sentences))
        sides = [
            (self._whole(message[: joint.start()]), joint, self._whole(message[joint.end() :]))
            for joint in _JOINTS.finditer(message)
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
        return message

    def _joint(self, text: str) -> str:
        word = text.strip()
        return text.replace(word, self._words.get(word, word))


def _has_holes(template: str) -> bool:
    return any(name is not None for _, name, _, _ in string.Formatter().parse(template))


def _pattern(template: str, hole: str) -> str:
    parsed = string.Formatter().parse(template)
    return "".join(re.escape(literal) + ("" if name is None else hole) for literal, name, _, _ in parsed)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
