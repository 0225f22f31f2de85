"""Keep translated pages in step with their sources: `python -m tools.translated_pages`.

A translated page names its source, and the hash of each section of it that was translated, in a comment at
its end. A test fails once a section of the source has changed. Revise the translation of the sections that
the command names, then run it with `--revised`, which writes the hashes of today.
"""

import hashlib
import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
LANGUAGES = ("ru", "uz")
SOURCES = {
    "first-test.md": "tutorial/first-test.md",
    "record-a-test.md": "how-to/record-a-test.md",
    "review-runs.md": "how-to/review-runs.md",
    "settings.md": "how-to/settings.md",
}
_STAMP = re.compile(r"\n% translated from \S+: (.*)\n\Z")


def sections(text: str) -> list[str]:
    """Parts of a page, each from its heading on; headings within code blocks are none."""
    parts, is_code = [""], False
    for line in text.splitlines():
        is_code ^= line.startswith("```")
        if line.startswith("#") and not is_code:
            parts.append("")
        parts[-1] += f"{line}\n"
    return [part.strip() for part in parts if part.strip()]


def stamp(name: str) -> str:
    """Hashes of the sections of a source, as a translation bears them."""
    text = (DOCS / SOURCES[name]).read_text("utf-8")
    return " ".join(hashlib.sha256(part.encode()).hexdigest()[:8] for part in sections(text))


def faults(page: Path) -> list[str]:
    """What of a translated page is not as its source."""
    text = page.read_text("utf-8")
    source = sections((DOCS / SOURCES[page.name]).read_text("utf-8"))
    found = _STAMP.search(text)
    known = found[1].split() if found else []
    if len(known) != len(source) or len(sections(text)) != len(source):
        return [f"{page}: its sections are not those of {SOURCES[page.name]}"]
    now = stamp(page.name).split()
    titles = [part.splitlines()[0].lstrip("# ") for part in source]
    changed = [title for title, old, new in zip(titles, known, now, strict=True) if old != new]
    return [f"{page}: section {title!r} of {SOURCES[page.name]} has changed: revise it" for title in changed]


def pages() -> list[Path]:
    """All translated pages."""
    return [DOCS / language / name for language in LANGUAGES for name in SOURCES]


def main() -> None:
    """Name what is to be revised, or write the hashes of today."""
    for page in pages():
        if "--revised" in sys.argv:
            text = _STAMP.sub("\n", page.read_text("utf-8")).rstrip()
            made = f"{text}\n\n% translated from {SOURCES[page.name]}: {stamp(page.name)}\n"
            page.write_text(made, "utf-8")
        for fault in faults(page):
            sys.stdout.write(f"{fault}\n")


if __name__ == "__main__":
    main()
