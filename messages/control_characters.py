"""Makes visible what in foreign text would steer a terminal, or turn the direction of reading."""

import re

_UNSEEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069]")
"""Control characters but for tab and line feed, and those that set the direction."""


def show_control_characters(text: str) -> str:
    r"""Write control characters as their escapes, `\x1b` or `\u202e`; all else stays."""
    return _UNSEEN.sub(lambda found: _escape(ord(found[0])), text)


def _escape(code: int) -> str:
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def json_escapes(document: str) -> str:
    """Write control characters in the strings of a JSON document as its own escapes; it says the same."""
    return _UNSEEN.sub(lambda found: f"\\u{ord(found[0]):04x}", document)
