"""The catalogues: what the window says most is translated, and no translation loses or invents a value."""

import string
from pathlib import Path

import pytest

from messages.i18n import parse_po
from tools.translations import LOCALE, MESSAGES, ROOT, Text, collect, collect_messages, update

CATALOGUES = sorted(LOCALE.glob("*.po"))
OF_MESSAGES = sorted(MESSAGES.glob("*.po"))
TEXTS = collect()
TEMPLATES = collect_messages()
MUST = (
    "app/qt/window.py",
    "app/presenters/record/guidance.py",
    "app/presenters/results.py",
    "app/qt/settings/screen.py",
)


def fields(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


@pytest.mark.parametrize("path", CATALOGUES, ids=lambda path: path.stem)
def test_translations_take_the_values_of_their_texts(path: Path) -> None:
    for one, forms in parse_po(path.read_text(encoding="utf-8")).texts.items():
        for form in filter(None, forms):
            text = TEXTS.get(one, Text(one))
            assert fields(form) <= fields(one) | fields(text.many), one
            assert text.many or fields(form) == fields(one), one


@pytest.mark.parametrize("path", CATALOGUES, ids=lambda path: path.stem)
@pytest.mark.parametrize("file", MUST)
def test_navigation_guidance_results_and_settings_are_translated(path: Path, file: str) -> None:
    known = parse_po(path.read_text(encoding="utf-8")).texts
    wanted = [text.one for text in TEXTS.values() if file in text.files]
    assert wanted
    missing = [one for one in wanted if not known.get(one) or not all(known[one])]
    assert missing == [], "run `make translations` and translate them"


@pytest.mark.parametrize("path", CATALOGUES, ids=lambda path: path.stem)
def test_what_counts_has_all_forms(path: Path) -> None:
    catalogue = parse_po(path.read_text(encoding="utf-8"))
    for one, forms in catalogue.texts.items():
        text = TEXTS.get(one)
        if text is not None and text.many and any(forms):
            assert {catalogue.form(number) for number in range(200)} == set(range(len(forms))), one


def test_a_catalogue_is_written_anew_without_losing_a_word(tmp_path: Path) -> None:
    catalogue = tmp_path / "xx.po"
    catalogue.write_text(
        'msgid ""\nmsgstr ""\n"Plural-Forms: nplurals=2; plural=n != 1;\\n"\n\n'
        'msgid "Gone"\nmsgstr "Weg"\n\nmsgid "Start {x}"\nmsgstr "Los {x}"\n',
        encoding="utf-8",
    )
    texts = {
        "Start {x}": Text("Start {x}", files={"a.py"}),
        "{count} run": Text("{count} run", "{count} runs"),
        'a "b"\nc': Text('a "b"\nc'),
    }
    assert update(catalogue, texts) == ["{count} run", 'a "b"\nc']
    written = parse_po(catalogue.read_text(encoding="utf-8"))
    assert written.texts["Start {x}"] == ("Los {x}",)
    assert written.texts["{count} run"] == ("", "")
    assert list(written.texts) == list(texts)
    before = catalogue.read_text(encoding="utf-8")
    update(catalogue, texts)
    assert catalogue.read_text(encoding="utf-8") == before


@pytest.mark.parametrize("path", OF_MESSAGES, ids=lambda path: path.stem)
def test_translated_messages_keep_their_holes_and_are_still_said(path: Path) -> None:
    texts = parse_po(path.read_text(encoding="utf-8")).texts
    translated = {one: forms[0] for one, forms in texts.items() if any(forms)}
    assert len(translated) > 500
    for one, said in translated.items():
        assert fields(said) == fields(one), one
    assert sorted(translated.keys() - TEMPLATES.keys()) == [], "run `make translations`"


def test_templates_of_messages_are_read_from_the_syntax_tree(tmp_path: Path) -> None:
    source = tmp_path / "layer.py"
    source.write_text(
        '''"""A docstring is none."""
CODE = "not-a-message"
QUERY = "SELECT path, size FROM runs"
def say(count: "dict[str, int]", swapped):
    """Nor is this one."""
    message = (
        f"only {count:d} samples came"
        f" in {2.0} s" + (", they look swapped" if swapped else "") + ": check {braces}."
    )
    raise ValueError("too few " f"{count!r} came")
''',
        encoding="utf-8",
    )
    assert list(collect_messages([tmp_path])) == [
        "only {0} samples came in {1} s{2}: check {{braces}}.",
        ", they look swapped",
        "too few {0} came",
    ]


def test_values_are_not_built_into_texts(tmp_path: Path) -> None:
    source = tmp_path / "wrong.py"
    source.write_text('gettext(f"{x} runs")\n', encoding="utf-8")
    with pytest.raises(ValueError, match="braces"):
        collect(tmp_path)
    source.write_text('gettext("a" "b", x=1)\nN_(name)\n', encoding="utf-8")
    assert list(collect(tmp_path)) == ["ab"]
    assert (ROOT / "messages" / "locale").is_dir()
