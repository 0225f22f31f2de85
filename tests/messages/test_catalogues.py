"""The catalogues: they hold the texts of the source, no translation loses or invents a value, .mo is .po."""

import gettext
import io
import string
from pathlib import Path

import pytest
from babel.messages.catalog import Catalog
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po

from messages.i18n import LOCALE
from tools.translations import ROOT, extract, untranslated, update

CATALOGUES = sorted(LOCALE.glob("*/LC_MESSAGES/*.po"))
MUST = (
    "app/qt/window.py",
    "app/acquisition/guidance.py",
    "app/presenters/results.py",
    "app/qt/settings_screen.py",
)
RENEW = "run `make translations`"


@pytest.fixture(scope="module")
def texts() -> Catalog:
    return extract()


def catalogue_of(path: Path) -> Catalog:
    return read_po(io.BytesIO(path.read_bytes()))


def fields(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


def forms(text: str | tuple[str, ...]) -> tuple[str, ...]:
    return (text,) if isinstance(text, str) else tuple(text)


@pytest.mark.parametrize("path", CATALOGUES, ids=lambda path: path.parts[-3])
def test_translations_take_the_values_of_their_texts(path: Path) -> None:
    for entry in catalogue_of(path):
        english = forms(entry.id)
        for form in filter(None, forms(entry.string) if entry.id else ()):
            if len(english) > 1:
                assert fields(form) <= fields(english[0]) | fields(english[1]), entry.id
            else:
                assert fields(form) == fields(english[0]), entry.id


@pytest.mark.parametrize("path", CATALOGUES, ids=lambda path: path.parts[-3])
@pytest.mark.parametrize("file", MUST)
def test_navigation_guidance_results_and_settings_are_translated(
    path: Path, file: str, texts: Catalog
) -> None:
    known = catalogue_of(path)
    wanted = [text.id for text in texts if text.id and file in {name for name, _ in text.locations}]
    assert wanted
    missing = [one for one in wanted if one not in known or not all(forms(known[one].string))]
    assert missing == [], f"{RENEW} and translate them"


@pytest.mark.parametrize("path", CATALOGUES, ids=lambda path: path.parts[-3])
def test_the_compiled_catalogue_is_up_to_date(path: Path) -> None:
    compiled = io.BytesIO()
    write_mo(compiled, catalogue_of(path))
    compiled.seek(0)
    with path.with_suffix(".mo").open("rb") as file:
        shipped = gettext.GNUTranslations(file)
    expected = gettext.GNUTranslations(compiled)
    for entry in catalogue_of(path):
        one, *many = forms(entry.id)
        if not one:
            continue
        assert shipped.gettext(one) == expected.gettext(one), RENEW
        for count in range(30) if many else ():
            assert shipped.ngettext(one, many[0], count) == expected.ngettext(one, many[0], count), RENEW


def test_a_catalogue_is_renewed_without_losing_a_translation(tmp_path: Path) -> None:
    path = tmp_path / "xx.po"
    path.write_text(
        'msgid ""\nmsgstr ""\n"Language: de\\n"\n"Plural-Forms: nplurals=2; plural=n != 1;\\n"\n'
        '"POT-Creation-Date: 2026-11-22 12:00+0000\\n"\n\n'
        'msgid "Gone"\nmsgstr "Weg"\n\nmsgid "Start {x}"\nmsgstr "Los {x}"\n',
        encoding="utf-8",
    )
    texts = Catalog()
    texts.add("Start {x}", locations=[("a.py", 1)])
    texts.add(("{count} run", "{count} runs"))
    texts.add('a "b"\nc')
    assert untranslated(update(path, texts)) == ["{count} run", 'a "b"\nc']
    written = catalogue_of(path)
    assert written["Start {x}"].string == "Los {x}"
    assert "Gone" not in written
    assert [entry.id for entry in written if entry.id] == [
        "Start {x}",
        ("{count} run", "{count} runs"),
        'a "b"\nc',
    ]
    with path.with_suffix(".mo").open("rb") as file:
        assert gettext.GNUTranslations(file).gettext("Start {x}") == "Los {x}"
    before = path.read_bytes()
    update(path, texts)
    assert path.read_bytes() == before


def test_texts_are_read_from_the_syntax_tree(tmp_path: Path) -> None:
    (tmp_path / "layer.py").write_text(
        '''"""A docstring is none."""
CODE = "not-a-message"
NAME = N_("Name")
def fail(path, count, first):
    warn = result_warning("too-short", "only {time_s:.1f} s" " are left", time_s=1.0)
    if count:
        raise errors.PortError("{port} is " "busy", port=path)
    if first:
        raise ValueError("for programmers")
    gettext("first" if first else "last")
    message("{count} file", plural="{count} files", count=2)
    return ngettext("{count} run", "{count} runs", count)
''',
        encoding="utf-8",
    )
    assert {text.id for text in extract([tmp_path]) if text.id} == {
        "Name",
        "only {time_s:.1f} s are left",
        "{port} is busy",
        "first",
        "last",
        ("{count} run", "{count} runs"),
        ("{count} file", "{count} files"),
    }


@pytest.mark.parametrize(
    "text", ['gettext(f"{x} runs")', 'message(f"{x} runs")', 'N_("a" + b)', 'PortError(f"{x} runs")']
)
def test_values_are_not_built_into_texts(tmp_path: Path, text: str) -> None:
    (tmp_path / "wrong.py").write_text(f"{text}\n", encoding="utf-8")
    with pytest.raises(ValueError, match="fields"):
        extract([tmp_path])
    assert LOCALE.is_relative_to(ROOT)
