"""Programs that import public modules by their earlier names still run."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest
from psabench import moved


@pytest.mark.parametrize("name", moved.NAMES)
def test_an_earlier_name_gives_the_module_of_today(name: str) -> None:
    now = import_module(f"psabench.{moved.NAMES[name]}")
    assert import_module(f"psabench.{name}") is now
    assert now.__spec__ is not None
    assert now.__name__ == now.__spec__.name == f"psabench.{moved.NAMES[name]}"


def test_an_earlier_name_comes_first_in_a_program() -> None:
    program = "from psabench.devices import Psd1; import psabench.lineport as port; print(Psd1.title, port.__name__)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "PSD-1 psabench.link.lineport\n", "")


def test_a_name_that_never_was_is_no_module() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"psabench\.linesport"):
        import_module("psabench.linesport")
