"""The program that type checkers read, and the types of the compiled part."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path
from typing import Any

import typed
from conftest import DATA

from greybox import _core


def test_the_typed_program_runs() -> None:
    assert typed.main(DATA / "pmsm.csv").verdict == "usable"


def functions(of: list[ast.stmt]) -> dict[str, list[str]]:
    """The functions and properties of a stub by name, with the names of their arguments."""
    found = {one.name: [argument.arg for argument in one.args.args] for one in of if isinstance(one, ast.FunctionDef)}
    return {name: [one for one in names if one not in ("self", "cls")] for name, names in found.items()}


def arguments(of: Any) -> list[str]:
    return [name for name in inspect.signature(of).parameters if name not in ("self", "slf")] if callable(of) else []


def public(of: Any) -> set[str]:
    return {name for name in vars(of) if not name.startswith("_")}


def test_the_stub_has_all_that_is_compiled_with_its_arguments() -> None:
    stub = ast.parse(Path(_core.__file__).with_name("_core.pyi").read_text()).body
    classes = {one.name: functions(one.body) for one in stub if isinstance(one, ast.ClassDef)}
    assert set(classes) | set(functions(stub)) == public(_core)
    for name, names in functions(stub).items():
        assert arguments(getattr(_core, name)) == names, name
    for name, methods in classes.items():
        of = getattr(_core, name)
        assert {one for one in methods if not one.startswith("_")} == public(of), name
        for method, names in methods.items():
            if not method.startswith("__"):
                assert arguments(getattr(of, method)) == names, f"{name}.{method}"
        if "__new__" in methods:
            assert arguments(of) == methods["__new__"], name
