"""The private copy of the sources: what a mutant has made goes, even while its emulator still runs."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from tests.mutants.tree import Tree


def test_a_program_that_still_runs_is_replaced_by_the_unmutated_one(tmp_path: Path) -> None:
    """An emulator that hangs keeps its file busy, and writing into it would end the whole run of mutants."""
    tree = Tree.__new__(Tree)
    tree.folder, tree._kept = tmp_path / "device", tmp_path / "kept"
    program, kept = tree.folder / "build/psa-emu", tree._kept / "build/psa-emu"
    for path, word in ((program, "mutant"), (kept, "unmutated")):
        path.parent.mkdir(parents=True)
        shutil.copy2("/bin/cat", path)
        with path.open("ab") as to:
            to.write(word.encode())
    os.utime(kept, (1.0, 1.0))
    with subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as running:
        tree._restore()
        assert running.communicate(b"alive")[0] == b"alive"
    assert program.read_bytes() == kept.read_bytes()
    assert program.stat().st_mtime == 1.0
