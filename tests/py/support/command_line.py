"""The command line as a user sees it, for tests."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import pytest
from psabench import cli
from psabench.progress import Bar

QUIET = Bar(Path(os.devnull).open("w"))  # noqa: SIM115  # for as long as the tests run


def mistake_line(words: Sequence[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What a mistake gets: status 2 and this one line on standard error, nothing else."""
    assert cli.main(list(words)) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1), err
    assert err.startswith("psabench: ")
    return err
