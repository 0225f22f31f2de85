"""Collects what is to be translated out of the source into the catalogues: `make translations`.

What presenters and views show is marked in the source. The layers below know nothing of languages: every
text of theirs that reads like a message is taken as a template with numbered holes, for `translate_message`.
Texts that are gone leave the catalogues, new ones come in without a translation; what is translated stays.
"""

import ast
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from messages.i18n import parse_po

ROOT = Path(__file__).resolve().parent.parent
LOCALE = ROOT / "messages" / "locale"
MESSAGES = LOCALE / "messages"
LAYERS = tuple(
    ROOT / layer
    for layer in ("analysis", "app/acquisition", "app/runs", "app/simulated_stand", "config", "drivers")
)
"""Where messages come from that know of no language."""
_WORD = re.compile(r"\b[a-z]{2,}\b")
_HOLE = re.compile(r"\{\d+\}")
_MANY_HOLES = 3
"""With more of them, one word makes a message."""
_NO_MESSAGE = re.compile(r"\n|\\|^[A-Z]{4,} |\bnp\.|\w\[\w| \| None")
"""Statements of SQL and types that stand in quotes."""
_MARKS = {"gettext": 1, "N_": 1, "ngettext": 2}
"""Functions that mark texts, and how many of their arguments are texts."""


@dataclass(slots=True)
class Text:
    """A text of the source: of one, of many where it counts something, and the files that it stands in."""

    one: str
    many: str = ""
    files: set[str] = field(default_factory=set)


def collect(folder: Path = ROOT / "app") -> dict[str, Text]:
    """All texts that are marked, by the English one, in order. Raises ValueError on one that is made up."""
    found: dict[str, Text] = {}
    for path in sorted(folder.rglob("*.py")):
        name = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name
        for texts in _marked(path):
            text = found.setdefault(texts[0], Text(texts[0]))
            text.many = texts[1] if len(texts) > 1 else text.many
            text.files.add(name)
    return found


def collect_messages(folders: Iterable[Path] = LAYERS) -> dict[str, Text]:
    """Templates of the messages of the layers below, in order: texts of two words or more."""
    found: dict[str, Text] = {}
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        name = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name
        for template in _templates(ast.parse(path.read_text(encoding="utf-8"))):
            words = _HOLE.sub("", template)
            enough = 1 if len(_HOLE.findall(template)) > _MANY_HOLES else 2
            if len(_WORD.findall(words)) >= enough and " " in words.strip() and not _NO_MESSAGE.search(words):
                found.setdefault(template, Text(template)).files.add(name)
    return found


def update(path: Path, texts: dict[str, Text]) -> list[str]:
    """Write a catalogue anew. Returns the texts that have no translation."""
    before = path.read_text(encoding="utf-8")
    header = before.partition("\n\n")[0].rstrip("\n")
    known = parse_po(before).texts
    count = int(header.partition("nplurals=")[2].partition(";")[0])
    blocks = [header, *(_entry(text, known.get(text.one, ()), count) for text in texts.values())]
    path.write_text("\n\n".join(blocks) + "\n", encoding="utf-8", newline="\n")
    return [one for one in texts if not known.get(one) or not all(known[one])]


def _templates(node: ast.AST) -> Iterator[str]:
    """Texts of a tree, each whole; what stands in holes gives texts of its own. Docstrings are none."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return
    pieces = list(_pieces(node))
    if any(isinstance(piece, str) for piece in pieces):
        holes = iter(range(len(pieces)))
        yield "".join(_escaped(piece) if isinstance(piece, str) else f"{{{next(holes)}}}" for piece in pieces)
        pieces_left = [piece for piece in pieces if not isinstance(piece, str)]
    else:
        pieces_left = list(ast.iter_child_nodes(node))
    for child in pieces_left:
        yield from _templates(child)


def _pieces(node: ast.AST) -> Iterator[str | ast.AST]:
    """A text as its fixed words and the values between them."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        for part in node.values:
            yield from [part.value] if isinstance(part, ast.FormattedValue) else _pieces(part)
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        sides = [list(_pieces(side)) for side in (node.left, node.right)]
        if any(isinstance(piece, str) for side in sides for piece in side):
            for side, value in zip(sides, (node.left, node.right), strict=True):
                yield from side or [value]


def _escaped(text: str) -> str:
    return text.replace("{", "{{").replace("}", "}}")


def _marked(path: Path) -> Iterator[list[str]]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
            continue
        count = _MARKS.get(node.func.id, 0)
        if any(isinstance(part, ast.JoinedStr | ast.BinOp) for part in node.args[:count]):
            raise ValueError(f"{path}, line {node.lineno}: values go into {{braces}}, not into the text")
        values = [part.value for part in node.args[:count] if isinstance(part, ast.Constant)]
        texts = [value for value in values if isinstance(value, str)]
        if texts and len(texts) == count:
            yield texts


def _entry(text: Text, forms: tuple[str, ...], count: int) -> str:
    lines = [f"#: {' '.join(sorted(text.files))}"]
    if "{" in text.one:
        lines.append("#, python-brace-format")
    lines.append(f"msgid {_quoted(text.one)}")
    if text.many:
        lines.append(f"msgid_plural {_quoted(text.many)}")
        shown = (*forms, *[""] * count)[:count]
        lines += [f"msgstr[{number}] {_quoted(form)}" for number, form in enumerate(shown)]
    else:
        lines.append(f"msgstr {_quoted(forms[0] if forms else '')}")
    return "\n".join(lines)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def main() -> int:
    """Run as a program."""
    for folder, texts in ((LOCALE, collect()), (MESSAGES, collect_messages())):
        for path in sorted(folder.glob("*.po")):
            missing = update(path, texts)
            name = path.relative_to(LOCALE).as_posix()
            sys.stdout.write(f"{name}: {len(texts) - len(missing)} of {len(texts)} texts translated\n")
            for text in missing:
                sys.stdout.write(f"  {text!r}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
