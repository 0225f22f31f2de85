"""Renews the translation catalogues from the source: `make translations`.

Texts are first arguments of calls: `gettext`, `ngettext` and `N_` in presenters and views; `message` and
errors that carry a `Message` in the layers below. Texts that are gone leave the catalogues, new ones come in
without a translation. Each catalogue is compiled beside itself (.mo), which is what the program reads.
"""

import ast
import builtins
import string
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

from messages.i18n import DOMAIN, LOCALE

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = tuple(ROOT / name for name in ("analysis", "app", "config", "drivers", "messages"))
ENGLISH_ONLY = ROOT / "app" / "cli"
_FUNCTIONS = {"gettext", "N_", "message", "ngettext", "result_warning"}
_CODE_FIRST = {"result_warning"}
"""Functions whose second argument is the text, after a code."""
_SUFFIX = "Error"


def extract(folders: Iterable[Path] = PACKAGES) -> Catalog:
    """Collect the texts of a source tree. Raises ValueError where a text is an f-string."""
    catalogue = Catalog()
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        if path.is_relative_to(ENGLISH_ONLY):
            continue
        name = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name
        for text, line in _texts(path):
            if _has_words(text):
                catalogue.add(text, locations=[(name, line)])
    return catalogue


def update(path: Path, texts: Catalog) -> Catalog:
    """Bring the texts into a PO file, compile it, and return it."""
    with path.open("rb") as file:
        catalogue = read_po(file)
    catalogue.update(texts, no_fuzzy_matching=True, update_creation_date=False)
    with path.open("wb") as file:
        write_po(file, catalogue, width=0, include_lineno=False, ignore_obsolete=True)
    with path.with_suffix(".mo").open("wb") as file:
        write_mo(file, catalogue)
    return catalogue


def untranslated(catalogue: Catalog) -> list[str]:
    """English texts without a translation, or without one of its plural forms."""
    return [
        text.id if isinstance(text.id, str) else text.id[0]
        for text in catalogue
        if text.id and not (all(text.string) if isinstance(text.string, tuple) else text.string)
    ]


def _texts(path: Path) -> Iterator[tuple[str | tuple[str, str], int]]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and node.args and _carries_text(node.func):
            plural = [keyword.value for keyword in node.keywords if keyword.arg == "plural"]
            if isinstance(node.func, ast.Name) and node.func.id == "ngettext":
                plural = node.args[1:2]
            many = [text for argument in plural for text in _constants(argument, path)]
            for text in _constants(node.args[_function_name(node.func) in _CODE_FIRST], path):
                yield ((text, many[0]) if many else text), node.lineno


def _has_words(text: str | tuple[str, str]) -> bool:
    """Tell whether there is anything to translate beside the fields."""
    one = text if isinstance(text, str) else text[0]
    return any(letter.isalpha() for literal, *_ in string.Formatter().parse(one) for letter in literal)


def _function_name(function: ast.expr) -> str:
    return function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")


def _carries_text(function: ast.expr) -> bool:
    name = _function_name(function)
    return name in _FUNCTIONS or (name.endswith(_SUFFIX) and not hasattr(builtins, name))


def _constants(argument: ast.expr, path: Path) -> Iterator[str]:
    """Yield the text of an argument; both texts of a conditional expression."""
    match argument:
        case ast.Constant(value=str(text)) if text:
            yield text
        case ast.IfExp(body=body, orelse=orelse):
            yield from _constants(body, path)
            yield from _constants(orelse, path)
        case ast.JoinedStr() | ast.BinOp():
            raise ValueError(f"{path}, line {argument.lineno}: put values into {{fields}} of the template")


def main() -> int:
    """Renew all catalogues, and print what is not translated."""
    texts = extract()
    for path in sorted(LOCALE.glob(f"*/LC_MESSAGES/{DOMAIN}.po")):
        missing = untranslated(update(path, texts))
        sys.stdout.write(f"{path.parts[-3]}: {len(texts) - len(missing)} of {len(texts)} texts translated\n")
        sys.stdout.writelines(f"  {text!r}\n" for text in missing)
    return 0


if __name__ == "__main__":
    sys.exit(main())
