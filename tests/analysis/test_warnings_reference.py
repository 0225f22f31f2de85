"""Every warning that an analysis can give is explained in the reference, and nothing else is."""

import re
from pathlib import Path

from analysis.one_mass.parts import PARTS
from analysis.results.diagnosis import SENTENCES

ROOT = Path(__file__).resolve().parents[2]
CODE = r'"([a-z0-9]+(?:-[a-z0-9]+)+|spikes|frozen|clipped)"'


def test_the_reference_explains_every_warning() -> None:
    paths = [path for path in (ROOT / "analysis").rglob("*.py") if path.parent.name != "calibration"]
    sources = "\n".join(path.read_text("utf-8") for path in paths)
    given = set(re.findall(r"(?:ResultWarning|_warning)\(\s*" + CODE, sources))
    given |= set(re.findall(r"^_CODE = " + CODE, sources, re.MULTILINE))
    given |= set(re.findall(r"^    " + CODE + r": \(", sources, re.MULTILINE))
    given |= {"frozen", "clipped", "gauge-1-drifts", "gauge-2-drifts", "gauge-1-range", "gauge-2-range"}
    given |= {code for code, sentence in SENTENCES.items() if sentence}
    given |= {part.name for part in PARTS}
    lines = (ROOT / "docs" / "reference" / "warnings.md").read_text("utf-8").splitlines()
    first_cells = [line.split("|")[1] for line in lines if line.startswith("| `")]
    explained = {code for cell in first_cells for code in re.findall(r"`([a-z0-9-]+)`", cell)}

    assert given == explained
