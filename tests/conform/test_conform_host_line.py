"""The host suite on the line port: a C host that passes, broken ones that are caught, waves that are the board's."""

from __future__ import annotations

import json
import os
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from broken_hosts import ROOT, BrokenHost, build
from broken_lines import BROKEN_LINES
from psabench import cli
from psabench.conform.host import runner
from psabench.conform.host.line_cases import LINE_CASES, LineFrame, wave
from psabench.control import Control
from psabench.emulator import Emulator
from psabench.lineport import LineDecoder


def judged(out: Path, *args: str) -> tuple[int, dict[str, Any]]:
    status = cli.main(["conform", "host", "--out", str(out), *args])
    return status, json.loads((out / "conform.json").read_text())


@pytest.mark.host
@pytest.mark.timeout(300)
def test_a_c_host_on_the_line_conforms(tmp_path: Path) -> None:
    host = build(tmp_path, main="host_line.c")
    status, told = judged(tmp_path / "out", "--command", f"{host} {{line}}")
    bad = {t["test"]: (t["saw"], t["due"]) for t in told["tests"] if t["verdict"] in ("failed", "inconclusive")}
    assert (status, bad) == (0, {})
    assert {t["scene"] for t in told["tests"] if t["scene"]} == set(LINE_CASES)


@pytest.mark.host
@pytest.mark.parametrize("broken", BROKEN_LINES, ids=lambda b: b.name)
def test_a_broken_host_on_the_line_is_caught(broken: BrokenHost, tmp_path: Path) -> None:
    host = build(tmp_path, broken, main="host_line.c")
    status, told = judged(tmp_path / "out", "--command", f"{host} {{line}}", "--case", broken.case)
    assert status == 1
    assert told["requirements"][broken.requirement] == "failed", told["requirements"]


@pytest.mark.host
def test_a_host_that_does_not_open_the_port_is_told_so(tmp_path: Path) -> None:
    status, told = judged(tmp_path, "--command", "true {line}", "--case", "line_good")
    assert status == 1
    assert {t["reason"] for t in told["tests"] if t["scene"]} == {
        "the host did not open the line port, or did not read it"
    }


def test_each_line_case_is_judged_and_on_the_page() -> None:
    from psabench.conform.host import can_checks, line_checks

    assert can_checks.__name__ != line_checks.__name__
    page = (ROOT / "docs/conform_host.md").read_text()
    assert set(LINE_CASES) <= {j.case for j in runner.wanted()}
    for name in LINE_CASES:
        assert f"`{name}`" in page


@pytest.mark.host
def test_waves_are_those_of_the_emulated_board(tmp_path: Path) -> None:
    """What the suite plays on the line is, sample by sample, what the emulator's line port gives for the same words."""
    taken = bytearray()
    with (
        Emulator("quiet", pace="step", extra=["--line", tmp_path / "line"]) as emulator,
        Control(emulator.control_path or Path()) as control,
    ):
        control.call("run", for_s=0.25)
        port = os.open(tmp_path / "line", os.O_RDONLY | os.O_NOCTTY)

        def read() -> None:
            with suppress(OSError):  # the emulator has hung up
                while data := os.read(port, 65536):
                    taken.extend(data)

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        control.call("run", for_s=0.03)
    reader.join(30.0)
    os.close(port)
    x = np.frombuffer(bytes(taken), np.uint8)
    frames = LineDecoder().feed(bytes(taken))
    assert len(frames) >= 10
    for fall, rise, words in zip(frames.fall, frames.rise, frames.words, strict=True):
        w, t = [int(v) - (1 << 32 if v >> 31 else 0) for v in words[:3].tolist()], int(words[3])
        made = wave(LineFrame(codes=(w[0], w[1], w[2], t & 0xFFFF), channel=t >> 16 & 15, status=t >> 20 & 15))
        assert len(made) == rise - fall
        assert (made == x[fall:rise]).all()
