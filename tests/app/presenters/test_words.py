"""Translation: values, plural forms, what has no translation, and catalogues as translators write them."""

import pytest

from messages import i18n
from messages.i18n import LANGUAGE_VARIABLE, N_, gettext, languages, ngettext, parse_po

RUSSIAN = r"""# A comment
msgid ""
msgstr ""
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

msgid "not yet"
msgstr ""
"""


@pytest.fixture
def russian(monkeypatch: pytest.MonkeyPatch) -> None:
    catalogue = parse_po(RUSSIAN)
    monkeypatch.setattr(i18n, "_in_use", lambda: catalogue)


def test_english_is_what_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(LANGUAGE_VARIABLE, raising=False)
    assert gettext("Pull back to {target}", target="12 mm") == "Pull back to 12 mm"
    assert gettext("{braces} without values stay") == "{braces} without values stay"
    assert [ngettext("{count} run", "{count} runs", count) for count in (0, 1, 2)] == [
        "0 runs",
        "1 run",
        "2 runs",
    ]
    assert N_("Slip") == "Slip"
    assert languages()[0] == "en"


def test_a_language_that_is_none_stays_english(monkeypatch: pytest.MonkeyPatch) -> None:
    for strange in ("xx", "", "../../etc/passwd"):
        monkeypatch.setenv(LANGUAGE_VARIABLE, strange)
        assert gettext("Start") == "Start"


@pytest.mark.usefixtures("russian")
def test_texts_are_translated_with_their_values() -> None:
    assert gettext("Pull back to {target}", target="12 мм") == "Оттяните до 12 мм"
    assert gettext('a "quoted"\nline') == 'строка "в кавычках"'
    assert gettext("not yet") == "not yet"
    assert gettext("unknown {name}", name="x") == "unknown x"


@pytest.mark.usefixtures("russian")
@pytest.mark.parametrize(
    ("count", "said"),
    [
        (1, "1 запись"),
        (3, "3 записи"),
        (5, "5 записей"),
        (11, "11 записей"),
        (21, "21 запись"),
        (0, "0 записей"),
    ],
)
def test_counts_take_the_form_of_their_number(count: int, said: str) -> None:
    assert ngettext("{count} run", "{count} runs", count) == said
