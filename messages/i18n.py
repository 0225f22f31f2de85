"""Translation by gettext: English in the source, a catalogue in `messages/locale` for each other language.

Only the window calls `use_language`, and hands `language()` to the processes in which it formats text. The
command line, logs and files are English whatever SLIPSTAND_LANGUAGE says.
"""

import gettext as gettext_module
from pathlib import Path

from messages.message import Message

LANGUAGE_VARIABLE = "SLIPSTAND_LANGUAGE"
ENGLISH = "en"
DOMAIN = "slipstand"
LOCALE = Path(__file__).parent / "locale"

_language = ENGLISH
_translations = gettext_module.NullTranslations()


def use_language(code: str) -> None:
    """Translate into a language from now on; into none if there is no catalogue for it."""
    global _language, _translations  # noqa: PLW0603 - gettext's own state: one language a process
    _language = code if code in languages() else ENGLISH
    _translations = gettext_module.translation(DOMAIN, LOCALE, [_language], fallback=True)


def language() -> str:
    """Code of the language in use."""
    return _language


def languages() -> tuple[str, ...]:
    """Codes of all languages, English first."""
    return (ENGLISH, *sorted(path.parts[-3] for path in LOCALE.glob(f"*/LC_MESSAGES/{DOMAIN}.mo")))


def language_names() -> dict[str, str]:
    """Names of all languages, each in itself, by code: its translation of "English"."""
    return {
        code: gettext_module.translation(DOMAIN, LOCALE, [code], fallback=True).gettext(_OWN_NAME)
        for code in languages()
    }


def gettext(text: str, /, **values: object) -> str:
    """Translate a text, then replace its `{fields}`; without values braces stay as they are."""
    translated = _translations.gettext(text) if text else ""
    return translated.format(**values) if values else translated


def ngettext(one: str, many: str, count: int, /, **values: object) -> str:
    """Translate a text that counts something; `{count}` in it is the number."""
    return _translations.ngettext(one, many, count).format(count=count, **values)


def N_(text: str) -> str:  # noqa: N802 - the name that gettext recommends
    """Mark a text for translation that is translated where it is shown, as in a table of names."""
    return text


_OWN_NAME = N_("English")


def translate(message: Message | str) -> str:
    """Render a message, or a text without fields, in the language in use."""
    return message.render(_translations) if isinstance(message, Message) else gettext(message)
