#!/usr/bin/env python3
"""Writes `python/kalmems/_kalmems.pyi`: the types of the module that Rust makes, as its functions have them.

    stubs.py PROGRAM          builds the module by the program `maturin` at this path, and writes what it says of its types
    stubs.py PROGRAM --check  writes nothing; fails where the file differs from what the module says

PyO3 puts names, types and descriptions of what it exports into the library, and maturin reads them there. Types that PyO3 cannot know, such as those of
arrays, stand as text in the signatures in `src`; here they become types, by the names below.
"""

import ast
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
KEPT = HERE / "python/kalmems/_kalmems.pyi"

NAMES = '''
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Numbers = NDArray[np.float64]
_Column = tuple[str, str, int, int, NDArray[np.uint8], NDArray[np.bool_] | None]
_Progress = Callable[[str, int, int], object] | None
_Function = tuple[int | None, Callable[..., Any] | None] | None
'''


class Types(ast.NodeTransformer):
    """Texts become types where types stand."""

    def visit_arg(self, argument: ast.arg) -> ast.arg:
        argument.annotation = typed(argument.annotation)
        return argument

    def visit_FunctionDef(self, function: ast.FunctionDef) -> ast.FunctionDef:
        function.returns = typed(function.returns)
        self.generic_visit(function)
        return function


def typed(annotation: "ast.expr | None") -> "ast.expr | None":
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        return ast.parse(annotation.value, mode="eval").body
    return annotation


def generated(maturin: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        options = ["--features", "stubs", "--locked", "--quiet", "--target-dir", "target", "--out", folder]
        subprocess.run([maturin, "generate-stubs", *options], cwd=HERE, check=True)
        stub = ast.parse((Path(folder) / "kalmems/_kalmems.pyi").read_text())
    last = max(place for place, node in enumerate(stub.body) if isinstance(node, ast.ImportFrom))
    stub.body[last + 1 : last + 1] = ast.parse(NAMES).body
    text = ast.unparse(ast.fix_missing_locations(Types().visit(stub)))
    if "Incomplete" in text.replace("from _typeshed import Incomplete", ""):
        sys.exit("a type is not known; write it into the signature in `src`")
    return f"# Written by `stubs.py` from the signatures in `src`.\n{text}\n"


def main() -> None:
    maturin, *told = sys.argv[1:]
    text = generated(maturin)
    if told == ["--check"]:
        if KEPT.read_text() != text:
            sys.exit(f"{KEPT} is not what the module says; run `{Path(__file__).name} {maturin}`")
        return
    KEPT.write_text(text)


if __name__ == "__main__":
    main()
