"""For all tests: Ctrl-C for the programs that they start, and a folder that everybody may enter.

A runner in the background (`make test &` in a script, many CI runners) starts us with SIGINT ignored; programs would
inherit that, and the tests that press Ctrl-C would wait for ever.
"""

import signal
from pathlib import Path

import pytest

signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def shared_path(tmp_path: Path) -> Path:
    """tmp_path with the folders above it, which pytest makes its user's own, passable to everybody."""
    for folder in tmp_path.parents:
        if "pytest-of-" in str(folder):
            folder.chmod(0o755)
    return tmp_path
