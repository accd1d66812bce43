"""The documentation in the module equals its stub file."""

from __future__ import annotations

import ast
import doctest
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

import lazygrid
from lazygrid import _lazygrid


def documented(body: list[ast.stmt], name: str = "") -> Iterator[tuple[str, str]]:
    """The classes and functions of a stub file, with their documentation."""
    for node in body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            said = ast.get_docstring(node)
            if said and not any(ast.unparse(base) == "TypedDict" for base in getattr(node, "bases", [])):
                yield name + node.name, said
        if isinstance(node, ast.ClassDef):
            yield from documented(node.body, f"{node.name}.")


STUB = Path(str(_lazygrid.__file__)).with_name("_lazygrid.pyi")
DOCUMENTED = dict(documented(ast.parse(STUB.read_text()).body))


@pytest.mark.parametrize("name", DOCUMENTED)
def test_stub_and_module_say_the_same(name: str) -> None:
    found = _lazygrid
    for part in name.split("."):
        found = getattr(found, part)
    assert inspect.getdoc(found) == DOCUMENTED[name]


@pytest.mark.parametrize("name", lazygrid.__all__)
def test_everything_public_is_documented(name: str) -> None:
    assert name == "__version__" or inspect.getdoc(getattr(lazygrid, name))


def test_the_example_of_the_package_runs() -> None:
    finder, runner = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner()
    for example in finder.find(lazygrid):
        runner.run(example)
    assert runner.tries > 0 and runner.failures == 0
