"""A function has at most eight named parameters, `self` among them: options travel in a Struct."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("analysis", "app", "benchmarks", "config", "drivers", "messages", "slipstand", "tools")
MOST = 8


def test_no_function_of_the_program_has_more() -> None:
    crowded = [
        f"{path.relative_to(ROOT)}: {found}"
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        for found in crowded_functions(path.read_text(encoding="utf-8"))
    ]
    assert not crowded


def test_positional_parameters_and_keywords_count() -> None:
    (found,) = crowded_functions(
        "class A:\n def f(self, a, b, /, c, d, *e, g, h, i, j, **k): ...\n def g(self): ..."
    )
    assert found == "f has 9 parameters"


def crowded_functions(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            count = len([*given.posonlyargs, *given.args, *given.kwonlyargs])
            if count > MOST:
                yield f"{node.name} has {count} parameters"
