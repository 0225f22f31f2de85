import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

PROJECT = Path(__file__).parents[2]


def commands(workflow: Path) -> list[str]:
    """Commands of all steps, without what stands before and behind them on their lines."""
    jobs = yaml.safe_load(workflow.read_text(encoding="utf-8"))["jobs"].values()
    scripts = [step["run"] for job in jobs for step in job["steps"] if "run" in step]
    return [part.strip().removeprefix("sudo ") for text in scripts for part in re.split(r"&&|;|\n", text)]


@pytest.mark.skipif(shutil.which("make") is None, reason="asks make")
@pytest.mark.parametrize(
    "workflow", sorted((PROJECT / ".github" / "workflows").glob("*.yml")), ids=lambda path: path.name
)
def test_workflows_call_targets_that_there_are(workflow: Path) -> None:
    called = [command.split()[1:] for command in commands(workflow) if command.startswith("make ")]
    targets = sorted({word for words in called for word in words if "=" not in word})
    assert targets
    asked = subprocess.run(
        ["make", "--dry-run", *targets], cwd=PROJECT, check=False, capture_output=True, text=True
    )
    assert asked.returncode == 0, asked.stderr
