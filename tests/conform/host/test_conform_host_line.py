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
from psabench.conform.host.cases_line import LINE_CASES
from psabench.conform.host.line_waves import LineFrame, form_of, wave
from psabench.emulator import Emulator
from psabench.link.control import Control
from psabench.link.lineport import CLK, DATA, LineDecoder, LineFormat


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
    assert status == 4
    assert {t["reason"] for t in told["tests"] if t["scene"]} == {
        "the host did not open the line port, or did not read it"
    }


def test_each_line_case_is_on_the_page() -> None:
    page = (ROOT / "docs/conform_host.md").read_text()
    for name in LINE_CASES:
        assert f"`{name}`" in page


@pytest.mark.host
@pytest.mark.parametrize("profile", ["w16", "w24", "lab32"])
def test_a_c_host_takes_the_words_of_a_profile(profile: str, tmp_path: Path) -> None:
    host = build(tmp_path, main="host_line.c")
    command = f"{host} {{line}} {{word_bits}} {{code_bits}}"
    status, told = judged(tmp_path / "out", "--command", command, "--profile", profile)
    bad = {t["test"]: (t["saw"], t["due"]) for t in told["tests"] if t["verdict"] in ("failed", "inconclusive")}
    has_no_status = profile == "w16"
    assert (status, bad) == (4 if has_no_status else 0, {})
    unseen = {i for i, verdict in told["requirements"].items() if verdict == "not observable"}
    assert ({"HOST-LINE-05", "HOST-OVER-01", "HOST-SETTLE-01"} <= unseen) == has_no_status
    assert told["requirements"]["HOST-RANGE-01"] == "passed"


@pytest.mark.host
@pytest.mark.parametrize("profile", ["w16", "w24", "lab32"])
def test_a_host_that_takes_the_words_for_others_is_caught(profile: str, tmp_path: Path) -> None:
    """Words of 32 bits and codes of 24, whatever comes."""
    host = build(tmp_path, main="host_line.c")
    status, told = judged(
        tmp_path / "out", "--command", f"{host} {{line}}", "--profile", profile, "--case", "line_good", "line_over"
    )
    assert status == 1
    assert told["requirements"]["HOST-RANGE-01" if profile == "lab32" else "HOST-LINE-03"] == "failed"


@pytest.mark.host
@pytest.mark.parametrize("profile", ["quiet", "w16", "w24", "lab32"])
def test_waves_are_those_of_the_emulated_board(profile: str, tmp_path: Path) -> None:
    """What the suite plays on the line is, sample by sample, what the emulator's line port gives for the same words.

    Where a period of CLK is no whole number of samples, an edge may be a sample off.
    """
    scenario: str | Path = profile
    if profile != "quiet":
        scenario = tmp_path / "scenario.yaml"
        scenario.write_text(f"units: [{{name: a, board: psa2, profile: {profile}}}]\n")
    form = form_of("article" if profile == "quiet" else profile)
    taken = line_of(scenario, tmp_path / "line")
    x = np.frombuffer(taken, np.uint8)
    frames = LineDecoder(LineFormat(word_bits=form.word_bits)).feed(taken)
    assert len(frames) >= 10
    for fall, rise, words in zip(frames.fall, frames.rise, frames.words, strict=True):
        w, t = [int(v) for v in words[:3].tolist()], int(words[3])
        made = wave(LineFrame(codes=(w[0], w[1], w[2], t & 0xFFFF), channel=t >> 16 & 15, status=t >> 20 & 15), form)
        seen = x[fall:rise]
        if form.clk_cycle.denominator == 1:
            assert len(made) == rise - fall
            assert (made == seen).all()
            continue
        assert abs(len(made) - int(rise - fall)) <= 1
        for wire in (DATA, CLK):
            mine, theirs = (np.flatnonzero(np.diff(s & wire)) for s in (made, seen))
            assert len(mine) == len(theirs)
            assert np.abs(mine - theirs).max() <= 1


def line_of(scenario: str | Path, port: Path) -> bytes:
    """30 ms of the emulator's line port after the set-up."""
    taken = bytearray()
    with (
        Emulator(scenario, pace="step", extra=["--line", port]) as emulator,
        Control(emulator.control_path or Path()) as control,
    ):
        control.call("run", for_s=0.25)
        fd = os.open(port, os.O_RDONLY | os.O_NOCTTY)

        def read() -> None:
            with suppress(OSError):  # the emulator has hung up
                while data := os.read(fd, 65536):
                    taken.extend(data)

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        control.call("run", for_s=0.03)
    reader.join(30.0)
    os.close(fd)
    return bytes(taken)
