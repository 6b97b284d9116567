"""Viewer files beside a VCD, and the decoders where sigrok looks for them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from psabench import cli
from psabench.boards.registry import BOARDS
from psabench.emulator import Emulator
from psabench.link.vcd import read_vcd


def recorded(folder: Path, board: str) -> Path:
    scenario, vcd = folder / "unit.yaml", folder / "run.vcd"
    scenario.write_text(f"units:\n  - {{name: a, board: {board}}}\n")
    with Emulator(scenario, cans=["none"], pace="free", control=False, extra=["--for", "5ms", "--vcd", vcd]) as emu:
        assert emu.wait(30) == 0
    return vcd


@pytest.mark.parametrize("board", [name for name in BOARDS if name != "gyro"])  # which has no unit without a platform
def test_session_files_name_the_lines_of_the_recording(tmp_path: Path, board: str) -> None:
    vcd = recorded(tmp_path, board)
    assert cli.main(["waveform", str(vcd)]) == 0
    shown = re.findall(rf"^{board}\.(\w+)$", vcd.with_suffix(".gtkw").read_text(), re.MULTILINE)
    wires = read_vcd(vcd).wires
    assert shown
    assert set(shown) <= set(wires)
    if board in ("psa2", "psd1"):
        assigned = re.findall(r"assigned_signal_name=(\w+)", vcd.with_suffix(".pvs").read_text())
        assert assigned
        assert set(assigned) <= set(wires)
    else:
        assert set(shown) == set(wires)


@pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")
def test_sigrok_finds_the_decoders_that_were_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.delenv("SIGROKDECODE_DIR", raising=False)
    for _ in range(2):  # the second time it replaces them
        assert cli.main(["waveform", "--decoders"]) == 0
    done = subprocess.run(["sigrok-cli", "-L"], capture_output=True, text=True, check=True, env=dict(os.environ))
    names = {line.split()[0] for line in done.stdout.splitlines() if line.strip()}
    assert {"psa2frame", "psd1cycle", "ads128x", "ads1256", "ad7712"} <= names


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([], "expected a VCD file or --decoders, got none"),
        (["nothing.vcd"], "No such file"),
        ([__file__], "expected a VCD file with a scope and wires"),
        (["--decoders", "--dir", "/proc/x"], "/proc/x"),
    ],
)
def test_waveform_says_what_is_wrong(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["waveform", *words]) == 2
    assert text in capsys.readouterr().err
