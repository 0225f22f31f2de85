"""Messages of the layers below are recognised by their templates, and said in another language."""

from collections.abc import Callable

import pytest

from messages.i18n import translate
from messages.phrasebook import Phrasebook

BOOK = Phrasebook(
    {
        "the disk has {0} left": "осталось {0}",
        "the disk has {0} left, enough for {1} s more": "осталось {0}, ещё на {1} s",
        "{0} of {1} readings of {2} {3}: they are left out.": "{2}: {0} из {1} {3}; исключены.",
        "stand still at the end of its range": "стоят на краю",
        "{0} mass {1} kg as given": "масса ({0}) {1} kg",
        "analysed with {0}.": "обработано: {0}.",
        "{0} is busy{1}: close it": "{0} занят{1}: закройте",
        ", held by {0}": ", держит {0}",
        "{0}: given up": "{0}: брошено",
        "it is away": "его нет",
        "{0} to {1} mm": "от {0} до {1} mm",
        ", since noon": ", с полудня",
        "braces {{like these}} in {0}": "скобки {{такие}} в {0}",
        "Hold it still": "Держите",
        "The table drifts by {0} mm/s. Hold it still": "Стол дрейфует на {0}. Держите!",
    },
    {"gauge 2": "датчик 2", "table": "стол", "and": "и"},
)


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ("the disk has 3.5 GB left", "осталось 3.5 GB"),
        ("The disk has 3.5 GB left", "Осталось 3.5 GB"),
        ("the disk has 3 GB left.", "осталось 3 GB."),
        ("the disk has -0 left, enough for 1e-9 s more", "осталось -0, ещё на 1e-9 s"),
        (
            "3 of 9 readings of gauge 2 stand still at the end of its range: they are left out.",
            "датчик 2: 3 из 9 стоят на краю; исключены.",
        ),
        ("analysed with table mass 3 kg as given.", "обработано: масса (стол) 3 kg."),
        (
            "analysed with table mass 3 kg as given and table mass 4 kg as given.",
            "обработано: масса (стол) 3 kg и масса (стол) 4 kg.",
        ),
        ("/dev/tty{0}\nis busy: close it", "/dev/tty{0}\nis busy: close it"),
        ("/dev/tty{0} is busy: close it", "/dev/tty{0} занят: закройте"),
        ("COM3 is busy, held by other.exe (7): close it", "COM3 занят, держит other.exe (7): закройте"),
        ("braces {like these} in {}", "скобки {такие} в {}"),
        ("The disk has 1 left. Hold it still", "Осталось 1. Держите"),
        ("/a b/x.h5: the disk has 1 left", "/a b/x.h5: осталось 1"),
        ("C:\\runs\\1.h5: Hold it still", "C:\\runs\\1.h5: Держите"),
        ("it is away, since noon: given up", "его нет, с полудня: брошено"),
        ("-3 to 1e3 mm", "от -3 до 1e3 mm"),
        ("push it to 3 mm", "push it to 3 mm"),
        ("Ещё 3 mm. The table drifts by 2 mm/s. Hold it still", "Ещё 3 mm. Стол дрейфует на 2. Держите!"),
        ("", ""),
        ("nobody knows this", "nobody knows this"),
        ("x" * 5000, "x" * 5000),
    ],
)
def test_a_message_is_said_by_its_template(message: str, said: str) -> None:
    assert BOOK.said(message) == said


def test_english_stays_english_to_the_letter(use_language: Callable[[str], None]) -> None:
    for language in ("en", "xx", ""):
        use_language(language)
        for message in ("the disk has 3 GB left, enough for 9 s more: free some space now", " odd  {0} %s "):
            assert translate(message) == message


def test_russian_retells_what_an_operator_meets(use_language: Callable[[str], None]) -> None:
    use_language("ru")
    assert translate("the disk has 3 GB left, enough for 9 s more: free some space now") == (
        "на диске осталось 3 GB, хватит ещё на 9 s: освободите место сейчас"
    )
    assert translate(
        "no release within 60 s: the table was held and never let go. Let go at once when armed"
    ) == ("за 60 s сброса не было: стол держали и не отпустили. Отпускайте сразу, когда готово")
    assert translate("what no layer says") == "what no layer says"
