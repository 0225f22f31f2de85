"""Translation: values, plural forms, what has no translation, and the language in use."""

import gettext as gettext_module
import io
import subprocess
import sys
from collections.abc import Callable

import pytest
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po

from messages import i18n
from messages.i18n import N_, gettext, language_names, languages, ngettext, translate
from messages.message import Message, message

RUSSIAN = r"""# A comment
msgid ""
msgstr ""
"Language: ru\n"
"Content-Type: text/plain; charset=UTF-8\n"
"Plural-Forms: nplurals=3; plural=(n%10==1 && n%100!=11 ? 0 : n%10>=2 && n%10<=4 && "
"(n%100<10 || n%100>=20) ? 1 : 2);\n"

#: somewhere.py
msgid "Pull back to {target}"
msgstr "Оттяните до {target}"

msgid "{count} run"
msgid_plural "{count} runs"
msgstr[0] "{count} запись"
msgstr[1] "{count} записи"
msgstr[2] "{count} записей"

msgid "a \"quoted\"\nline"
msgstr ""
"строка "
"\"в кавычках\""

msgid "{sentence} now"
msgstr "{sentence} сейчас"

msgid "not yet"
msgstr ""
"""


@pytest.fixture
def russian(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = io.BytesIO()
    write_mo(compiled, read_po(io.BytesIO(RUSSIAN.encode())))
    compiled.seek(0)
    monkeypatch.setattr(i18n, "_translations", gettext_module.GNUTranslations(compiled))
    monkeypatch.setattr(i18n, "_language", "ru")


def test_english_is_what_is_written() -> None:
    assert gettext("Pull back to {target}", target="12 mm") == "Pull back to 12 mm"
    assert gettext("{braces} without values stay") == "{braces} without values stay"
    assert [ngettext("{count} run", "{count} runs", count) for count in (0, 1, 2)] == [
        "0 runs",
        "1 run",
        "2 runs",
    ]
    assert N_("Slip") == "Slip"
    assert languages() == ("en", "ru", "uz")
    assert language_names() == {"en": "English", "ru": "Русский", "uz": "O‘zbekcha"}
    assert translate(message("{port} is busy", port="COM3")) == "COM3 is busy"


@pytest.mark.parametrize("code", ["xx", "", "../../etc/passwd"])
def test_a_language_that_is_none_stays_english(use_language: Callable[[str], None], code: str) -> None:
    use_language(code)
    assert i18n.language() == "en"
    assert gettext("Start") == "Start"


def test_languages_are_changed(use_language: Callable[[str], None]) -> None:
    use_language("ru")
    assert gettext("Start") == "Начало"
    use_language("en")
    assert gettext("Start") == "Start"


@pytest.mark.usefixtures("russian")
def test_texts_are_translated_with_their_values() -> None:
    assert gettext("Pull back to {target}", target="12 мм") == "Оттяните до 12 мм"
    assert gettext('a "quoted"\nline') == 'строка "в кавычках"'
    assert gettext("not yet") == "not yet"
    assert gettext("unknown {name}", name="x") == "unknown x"
    assert gettext("") == "", "gettext keeps the header of the catalogue under the empty text"


@pytest.mark.usefixtures("russian")
def test_messages_are_rendered_with_their_parts() -> None:
    part = message("Pull back to {target}", target="12 мм")
    assert translate(message("{sentence} now", sentence=part)) == "Оттяните до 12 мм сейчас"
    assert translate(message("{count} run", plural="{count} runs", count=3)) == "3 записи"
    assert translate(Message("")) == ""


@pytest.mark.usefixtures("russian")
@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (1, "1 запись"),
        (3, "3 записи"),
        (5, "5 записей"),
        (11, "11 записей"),
        (21, "21 запись"),
        (0, "0 записей"),
    ],
)
def test_counts_take_the_form_of_their_number(count: int, expected: str) -> None:
    assert ngettext("{count} run", "{count} runs", count) == expected


def test_the_environment_alone_translates_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The window reads SLIPSTAND_LANGUAGE; a command and a child process do not."""
    monkeypatch.setenv(i18n.LANGUAGE_VARIABLE, "ru")
    code = "import sys; from messages.i18n import gettext; sys.stdout.write(gettext('Start'))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "Start"
