"""Which tests a file has, read off its text: what cmocka runs, what pytest collects, what proves a requirement."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator


def registered_in_c(source: str) -> set[str]:
    """Names of the tests that a cmocka program runs: in a table that is handed to cmocka, and defined in the file."""
    code = re.sub(r"/\*.*?\*/|//[^\n]*", "", source, flags=re.DOTALL)
    names: set[str] = set()
    for table in re.finditer(r"\bconst struct CMUnitTest (\w+)\[\]\s*=\s*\{(.*?)\};", code, re.DOTALL):
        if re.search(rf"\bcmocka_run_group_tests(?:_name)?\([^;]*\b{table[1]}\b", code):
            names |= set(re.findall(r"\bcmocka_unit_test\w*\(\s*(\w+)", table[2]))
    return {n for n in names if re.search(rf"\bvoid {n}\(void \*\*\w+\)\s*\{{", code)}


def collected_in_python(source: str) -> set[str]:
    """Names of the test functions that pytest collects from a file; one that is skipped whatever happens is none."""
    names: set[str] = set()
    for node in ast.parse(source).body:
        inner = node.body if isinstance(node, ast.ClassDef) and node.name.startswith("Test") else [node]
        for f in inner:
            if isinstance(f, ast.FunctionDef) and f.name.startswith("test_"):
                marks = {ast.unparse(d).split("(")[0] for d in f.decorator_list}
                if not marks & {"pytest.mark.skip", "pytest.mark.xfail"}:
                    names.add(f.name)
    return names


# Which of a mark's arguments are ids.
IDS_OF = {
    "proves": slice(None),
    "active": slice(None),
    "dialogue": slice(None),
    "check": slice(1, None),
    "checks": slice(1),
}


def proved_in_python(source: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Functions marked @proves(ID, ...), @check(STIMULUS, ID, ...) and the like, and their ids.

    Raises ValueError where an id is no literal text.
    """
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        for mark in node.decorator_list:
            kind = ast.unparse(mark.func).rpartition(".")[2] if isinstance(mark, ast.Call) else ""
            if not isinstance(mark, ast.Call) or kind not in IDS_OF:
                continue
            args = mark.args[IDS_OF[kind]]
            ids = [a.value for a in args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
            if len(ids) != len(args) or (kind == "proves" and mark.keywords):
                raise ValueError(f"line {mark.lineno}: @{kind} of {node.name} wants literal ids")
            if ids or kind == "proves":
                yield node.name, tuple(ids)
