"""Reference of the Python package: docstrings, signatures and fields of the modules that programs use.

Made from their source; nothing is imported. Docstrings here are plain text with indented code, so Markdown takes them
as they are; reStructuredText, which autodoc expects, does not.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator
from pathlib import Path

from sitegen.prose import markdown

PACKAGE = "scripts/psabench"
# By their users: whoever opens a bench, reads boards, runs procedures, uses the libraries.
MODULES = (
    *("__init__", "bench", "errors", "faults", "instruments", "chips", "link/probe", "link/can_host", "link/vcd"),
    *(f"boards/{n}" for n in ("unit", "readings", "psa2/device", "psa2/frames", "psd1/device", "pmka/device")),
    *(f"boards/{n}/device" for n in ("pik", "gyro", "bins", "receiver")),
    *(f"procedures/{n}" for n in ("head_bench", "wire_bench", "result", "turns", "fourier", "reversal", "gyrocompass")),
    *("budget/accuracy", "budget/gum", "budget/influences", "estimate/uncertainty", "estimate/allan"),
    *("thermal/run", "thermal/result", "thermal/compensation", "thermal/apply"),
    *("sins/calibration_run", "sins/calibration", "sins/correction", "sins/increments"),
    *("native/nav", "native/nav_mc", "native/sins", "native/kalman", "native/strapdown", "native/koi"),
)
LINE_MOST = 100  # characters of a signature in one line
Function = ast.FunctionDef | ast.AsyncFunctionDef


def python_pages(root: Path, pages: Collection[str]) -> dict[str, str]:
    """Path and text of each page."""
    found = {}
    for name in MODULES:
        source = (root / PACKAGE / f"{name}.py").read_text(encoding="utf-8")
        dotted = ".".join(["psabench", *(p for p in name.split("/") if p != "__init__")])
        found[f"api/python/{dotted.removeprefix('psabench.')}.md"] = module_page(dotted, source, pages)
    return found


def module_page(dotted: str, source: str, pages: Collection[str]) -> str:
    """What a module has for others."""
    tree = ast.parse(source)
    parts = [f"# {dotted}", *_text_of(tree, pages)]
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and _is_public(node.name):
            parts += _class_parts(node, source, pages)
        elif isinstance(node, Function) and _is_public(node.name):
            parts += _function_parts(node, f"## `{node.name}()`", pages)
    return "\n\n".join(parts) + "\n"


def _is_public(name: str) -> bool:
    return not name.startswith("_")


def _text_of(node: ast.Module | ast.ClassDef | Function, pages: Collection[str]) -> Iterator[str]:
    text = ast.get_docstring(node)
    if text:
        yield markdown(text, "python", pages)


def _class_parts(node: ast.ClassDef, source: str, pages: Collection[str]) -> Iterator[str]:
    bases = ", ".join(ast.unparse(b) for b in node.bases)
    yield f"## `{node.name}`"
    yield f"```python\nclass {node.name}{f'({bases})' if bases else ''}\n```"
    yield from _text_of(node, pages)
    lines = source.split("\n")
    fields = [line for f in node.body if isinstance(f, ast.AnnAssign | ast.Assign) for line in _source(f, lines)]
    if fields:
        yield "```python\n" + "\n".join(fields) + "\n```"
    for f in node.body:
        if isinstance(f, Function) and (_is_public(f.name) or (f.name == "__init__" and ast.get_docstring(f))):
            yield from _function_parts(f, f"### `{node.name}.{f.name}`", pages)


def _source(node: ast.AnnAssign | ast.Assign, lines: list[str]) -> list[str]:
    """Its lines with their comments; none of a private name."""
    target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
    if isinstance(target, ast.Name) and not _is_public(target.id):
        return []
    return [line[node.col_offset :] for line in lines[node.lineno - 1 : node.end_lineno]]


def _function_parts(node: Function, heading: str, pages: Collection[str]) -> Iterator[str]:
    """Of an accessor its setter is left out: it has the same name."""
    decorators = [ast.unparse(d) for d in node.decorator_list]
    if any(d.endswith(".setter") or d == "overload" for d in decorators):
        return
    kept = [f"@{d}" for d in decorators if d in ("property", "classmethod", "staticmethod", "contextmanager")]
    yield heading
    yield "```python\n" + "\n".join([*kept, _signature(node)]) + "\n```"
    yield from _text_of(node, pages)


def _signature(node: Function) -> str:
    """In one line, or a line for each argument."""
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    line = f"def {node.name}({ast.unparse(node.args)}){returns}"
    if len(line) <= LINE_MOST:
        return line
    a = node.args
    plain = [*a.posonlyargs, *a.args]
    defaults: list[ast.expr | None] = [*[None] * (len(plain) - len(a.defaults)), *a.defaults]
    rows = [_argument(arg, default) for arg, default in zip(plain, defaults, strict=True)]
    if a.vararg or a.kwonlyargs:
        rows.append(f"*{ast.unparse(a.vararg) if a.vararg else ''}")
    rows += [_argument(arg, default) for arg, default in zip(a.kwonlyargs, a.kw_defaults, strict=True)]
    rows += [f"**{ast.unparse(a.kwarg)}"] if a.kwarg else []
    return f"def {node.name}(\n" + "".join(f"    {row},\n" for row in rows) + f"){returns}"


def _argument(arg: ast.arg, default: ast.expr | None) -> str:
    return ast.unparse(arg) + (f" = {ast.unparse(default)}" if default else "")
