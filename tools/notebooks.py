#!/usr/bin/env python3
"""Notebooks: examples/notebooks/NAME.py is the source (jupytext's percent format), NAME.ipynb is made from it by a run.

Usage:
    notebooks.py [NAME ...]           run and write them; all without names
    notebooks.py --check [NAME ...]   run and compare with what is stored; exit 1 and say where one differs

Needs the packages of .venv/site (tools/setup site). Printed text has to be equal; of pictures there have to be as many,
of the same size, for their bytes are a matter of the fonts. All run in one kernel, emptied in between: that saves
importing NumPy each time.
"""

from __future__ import annotations

import argparse
import base64
import os
import struct
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "examples/notebooks"
PACKAGES = ROOT / ".venv/site"
CELL_LIMIT_S = 120
LINE_MOST = 110  # characters of a difference that are shown
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
Cell = Any  # nbformat's, a mapping


def names() -> list[str]:
    """Of all notebooks."""
    return sorted(p.stem for p in FOLDER.glob("*.py"))


def fresh(name: str) -> Any:
    """A notebook from its source, without outputs; the same bytes each time."""
    import jupytext

    made = jupytext.read(FOLDER / f"{name}.py", fmt="py:percent")
    made.metadata = {"kernelspec": KERNEL, "language_info": {"name": "python"}}
    for number, cell in enumerate(made.cells):
        cell.id, cell.metadata = f"cell-{number}", {}
    return made


@contextmanager
def kernel() -> Iterator[Any]:
    """One for all notebooks, in their folder; it keeps no history."""
    from jupyter_client.manager import KernelManager

    with tempfile.TemporaryDirectory() as home:
        env = {k: v for k, v in os.environ.items() if k != "MPLBACKEND"}
        env["PYTHONPATH"] = os.pathsep.join(filter(None, [str(PACKAGES), env.get("PYTHONPATH")]))
        env |= {
            "OPENBLAS_NUM_THREADS": "1",
            "IPYTHONDIR": home,
            "JUPYTER_RUNTIME_DIR": home,
            "PYDEVD_DISABLE_FILE_VALIDATION": "1",
        }
        made = KernelManager(kernel_name="python3", transport="ipc", ip=f"{home}/k", connection_file=f"{home}/k.json")
        made.start_kernel(cwd=str(FOLDER), env=env, extra_arguments=["--HistoryManager.enabled=False"])
        try:
            yield made
        finally:
            made.shutdown_kernel(now=True)


def run(name: str, km: Any) -> Any:
    """The notebook with the outputs of a run. Raises nbclient's CellExecutionError with the cell that fails."""
    from nbclient import NotebookClient
    from nbformat.v4 import new_code_cell

    made = fresh(name)
    made.cells.insert(0, new_code_cell("%reset -f"))
    NotebookClient(made, km=km, timeout=CELL_LIMIT_S, record_timing=False).execute()
    made.metadata = {"kernelspec": KERNEL, "language_info": {"name": "python"}}
    del made.cells[0]
    for count, cell in enumerate((c for c in made.cells if c.cell_type == "code"), 1):
        _settle(cell, count)
    return made


def _settle(cell: Cell, count: int) -> None:
    """What differs from run to run and is no result: counts, pieces of a stream, the newline after a picture."""
    kept: list[Any] = []
    cell.execution_count = count
    for out in cell.outputs:
        if "execution_count" in out:
            out.execution_count = count
        if out.output_type == "stream" and kept and kept[-1].output_type == "stream" and kept[-1].name == out.name:
            kept[-1].text += out.text
        else:
            kept.append(out)
    cell.outputs = kept


def shown(notebook: Any) -> Iterator[tuple[str, str]]:
    """Where, and what is compared there: sources, printed text, sizes of pictures."""
    for number, cell in enumerate(notebook.cells):
        where = f"cell {number}"
        yield f"{where}, source", f"{cell.cell_type}\n{cell.source}"
        for out in cell.get("outputs", []):
            if out.output_type == "stream":
                yield f"{where}, {out.name}", out.text
            for kind, data in sorted(out.get("data", {}).items()):
                yield f"{where}, {kind}", _size_of(data) if kind == "image/png" else str(data)


def _size_of(png: str) -> str:
    """Width and height, from the header of the file."""
    width, height = struct.unpack(">II", base64.b64decode(png)[16:24])
    return f"{width} x {height}"


def differences(stored: Any, now: Any) -> list[str]:
    """A line each; the first of a text's lines that differs."""
    before, after = list(shown(stored)), list(shown(now))
    found: list[str] = []
    for (where, old), (where_now, new) in zip(before, after, strict=False):
        if where != where_now:
            return [*found, f"{where}: expected what is stored, got {where_now}"]
        if old != new:
            found.append(f"{where}: expected {_first_line(old, new)}, got {_first_line(new, old)}")
    if len(before) != len(after):
        found.append(f"expected {len(before)} sources, texts and pictures, got {len(after)}")
    return found


def _first_line(text: str, other: str) -> str:
    theirs = other.split("\n")
    lines = text.split("\n")
    line = next((x for k, x in enumerate(lines) if k >= len(theirs) or x != theirs[k]), "an end")
    return repr(line[:LINE_MOST])


def check(name: str, km: Any) -> list[str]:
    """What a run makes of a notebook that is not stored."""
    import nbformat

    path = FOLDER / f"{name}.ipynb"
    if not path.is_file():
        return [f"{name}: expected {path.relative_to(ROOT)}, got no such file (make notebooks)"]
    stored = nbformat.read(path, as_version=4)
    return [f"{name}: {line}" for line in differences(stored, run(name, km))]


def write(name: str, km: Any) -> None:
    """Runs it and stores it with its outputs."""
    import nbformat

    path = FOLDER / f"{name}.ipynb"
    text = nbformat.writes(run(name, km), version=4)
    path.write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    print(path.relative_to(ROOT))


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="first_frame, ...; all without names")
    parser.add_argument("--check", action="store_true", help="compare with what is stored, write nothing")
    args = parser.parse_args(argv)
    unknown = sorted(set(args.names) - set(names()))
    if unknown:
        parser.error(f"NAME: expected {', '.join(names())}, got {', '.join(unknown)}")
    if not PACKAGES.is_dir():
        print(f"{PACKAGES.relative_to(ROOT)}: expected packages, got none: tools/setup site", file=sys.stderr)
        return 2
    sys.path.append(str(PACKAGES))
    found: list[str] = []
    with kernel() as km:
        for name in args.names or names():
            if args.check:
                found += check(name, km)
            else:
                write(name, km)
    for line in found:
        print(line, file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
