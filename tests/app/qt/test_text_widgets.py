"""Texts as the window sets them."""

import pytest
from looking import plain

from app.qt.widgets.text import label, set_subscripts


@pytest.mark.parametrize(
    ("said", "seen"),
    [
        ("f_d falls with v_max", "f<sub>d</sub> falls with v<sub>max</sub>"),
        ("f_s > f_d & more", "f<sub>s</sub> &gt; f<sub>d</sub> &amp; more"),
        ("n<sub>1</sub> and u_s", "n<sub>1</sub> and u<sub>s</sub>"),
        ("p < 0.001 & more", "p < 0.001 & more"),
        ("20261122T144336_f_data.h5", "20261122T144336_f_data.h5"),
    ],
)
def test_symbols_in_sentences_are_set(said: str, seen: str) -> None:
    assert set_subscripts(said) == seen


def test_a_label_shows_no_markup(qapp: object) -> None:
    assert plain(label("f_s < f_d & more").text()) == "fs < fd & more"
