"""Viewer files beside a VCD, and the decoders where sigrok looks for them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest
import pywellen
from psabench import cli
from psabench.boards.board import PARALLEL_BUS
from psabench.boards.registry import BOARDS
from psabench.emulator import Emulator
from psabench.link.control import Control
from psabench.link.vcd import read_vcd
from psabench.logs import sessions
from psabench.places import CHECKOUT

from tests.py.boards.test_sigrok import sigrok, write

NEEDS_SIGROK = pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")


def recorded(folder: Path, board: str, *extra: str) -> Path:
    scenario, vcd = folder / "unit.yaml", folder / "run.vcd"
    scenario.write_text(f"units:\n  - {{name: a, board: {board}}}\n")
    on_platform = board == "gyro"  # which has no unit without one
    options: list[str | Path] = ["--for", "5ms", "--vcd", vcd, *(["--unit", "gyro"] if on_platform else []), *extra]
    with Emulator(
        "gyrocompass" if on_platform else scenario, cans=["none"], pace="free", control=False, extra=options
    ) as emu:
        assert emu.wait(30) == 0
    return vcd


@pytest.mark.parametrize("board", BOARDS)
def test_session_files_name_the_lines_of_the_recording(tmp_path: Path, board: str) -> None:
    vcd = recorded(tmp_path, board)
    assert cli.main(["waveform", str(vcd)]) == 0
    shown = re.findall(rf"^{board}\.(\w+)$", vcd.with_suffix(".gtkw").read_text(), re.MULTILINE)
    wires = read_vcd(vcd).wires
    assert shown
    assert set(shown) <= set(wires)
    assert set(shown) == set(wires)
    pvs = vcd.with_suffix(".pvs").read_text()
    assigned = re.findall(r"assigned_signal_name=(\w+)", pvs)
    assert assigned
    assert set(assigned) <= set(wires)
    assert set(re.findall(r"^(\w+).trace_height=", pvs, re.MULTILINE)) == set(wires)


def test_another_boards_recording_has_its_lines_in_gtkwave(tmp_path: Path) -> None:
    vcd = recorded(tmp_path, "pik")
    vcd.write_text(vcd.read_text().replace("module pik", "module new"))
    assert cli.main(["waveform", str(vcd)]) == 0
    shown = re.findall(r"^new\.(\w+)$", vcd.with_suffix(".gtkw").read_text(), re.MULTILINE)
    assert shown == list(read_vcd(vcd).wires)
    assert not vcd.with_suffix(".pvs").exists()


def test_the_shipped_sessions_are_those_of_the_table(tmp_path: Path) -> None:
    assert sessions.main([str(tmp_path)]) == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"{board}{ending}" for board in BOARDS for ending in (".pvs", ".gtkw")}
    for name in names:
        assert (CHECKOUT / "share" / name).read_text() == (tmp_path / name).read_text(), "run make docs"


@pytest.mark.parametrize("board", ["psa2", "psd1"])
@pytest.mark.parametrize("unit_ns", [1, 100])
def test_the_parser_of_surfer_reads_the_same_levels(tmp_path: Path, board: str, unit_ns: int) -> None:
    """pywellen, which shares nothing with our reader."""
    vcd = recorded(tmp_path, board, "--vcd-unit", str(unit_ns))
    theirs, ours = pywellen.Waveform(str(vcd)), read_vcd(vcd).wires
    scale_ns = theirs.timescale.factor * 10 ** (9 + theirs.timescale.unit.to_exponent())
    assert scale_ns == unit_ns
    found = {v.full_name.rpartition(".")[2]: [(t * scale_ns, int(x)) for t, x in v.tv] for v in theirs.all_vars()}
    assert found == {name: list(zip(w.t_ns.tolist(), w.level.tolist(), strict=True)) for name, w in ours.items()}
    assert sum(map(len, found.values())) > 100


@NEEDS_SIGROK
def test_sigrok_finds_the_decoders_that_were_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.delenv("SIGROKDECODE_DIR", raising=False)
    for _ in range(2):  # the second time it replaces them
        assert cli.main(["waveform", "--decoders"]) == 0
    done = subprocess.run(["sigrok-cli", "-L"], capture_output=True, text=True, check=True, env=dict(os.environ))
    names = {line.split()[0] for line in done.stdout.splitlines() if line.strip()}
    assert {"psa2frame", "psd1cycle", "ads128x", "ads1256", "ad7712", "psabus"} <= names


@cache
def shown_by_sigrok(decoder: str) -> str:
    environment = dict(os.environ) | {"SIGROKDECODE_DIR": str(CHECKOUT / "decoders")}
    show = ["sigrok-cli", "-P", decoder, "--show"]
    return subprocess.run(show, capture_output=True, text=True, check=True, env=environment).stdout


@NEEDS_SIGROK
@pytest.mark.parametrize("board", BOARDS)
def test_sigrok_has_the_decoders_of_the_sessions_with_these_channels_and_options(board: str) -> None:
    for stack in sessions.SESSIONS[board].stacks:
        for decoder in stack.decoders:
            text = shown_by_sigrok(decoder.id)
            for option, value in decoder.options.items():
                [choices] = re.findall(rf"^- {option}: .*\((.*)\)$", text, re.MULTILINE)
                assert f"'{value}'" in choices or (isinstance(value, int) and str(value) in choices)
            rows = re.findall(r"^- [\w-]+ \([^)]*\): ", text.partition("Annotation rows:")[2], re.MULTILINE)
            assert set(decoder.hidden) <= set(range(len(rows)))
        channels = re.findall(r"^- \w+ \(([^)]+)\): ", shown_by_sigrok(stack.decoders[0].id), re.MULTILINE)
        assert set(stack.channels) <= set(channels)


def decoded(vcd: Path, board: str, name: str) -> list[str]:
    """What a stack of one decoder shows of a recording, in its first row."""
    [stack] = [s for s in sessions.SESSIONS[board].stacks if s.name == name]
    [decoder] = stack.decoders
    channels = {channel.lower(): line for channel, line in stack.channels.items()}
    words = [decoder.id, *(f"{k}={v}" for k, v in {**channels, **decoder.options}.items())]
    row = {"counter": "edge_count", "psabus": "cycles:warnings", "timing": "time"}[decoder.id]
    return sigrok(vcd, ":".join(words), f"{decoder.id}={row}")


@contextmanager
def stepped(vcd: Path, unit: str) -> Iterator[Control]:
    """A bench of one unit whose time the control socket moves; its lines are in vcd afterwards."""
    scenario = vcd.with_name("unit.yaml")
    scenario.write_text(f"units: [{unit}]")
    with (
        Emulator(scenario, cans=["none"], pace="step", extra=["--vcd", vcd]) as emu,
        Control(emu.directory / "control") as control,
    ):
        yield control


def read_register(control: Control, address: int, strobe_ns: int = 800) -> int:
    """By a cycle on the bus, and a pause: cycles with no time between them are one strobe on the line."""
    reply = control.call("bus.read", unit="a", address=address, strobe_ns=strobe_ns)
    control.call("run", for_s=1e-5)
    return int(reply.result["data"])


@NEEDS_SIGROK
def test_a_pulseview_of_a_pik_shows_the_counters_that_the_host_reads(tmp_path: Path) -> None:
    vcd = tmp_path / "run.vcd"
    with stepped(vcd, "{name: a, board: pik, axes: {x: {sensor: mems, u0_v: 2.5}}}") as control:
        control.call("run", for_s=0.0455)
        count, seq = (read_register(control, address) for address in (3, 9))
    texts = decoded(vcd, "pik", "Count FXP")
    per_latch = [int(a) for a, b in pairwise([*texts, "1"]) if b == "1"]  # the last count before each begins again
    assert sum(per_latch[:seq]) == count > 10
    assert decoded(vcd, "pik", "Count FXN") == []
    assert decoded(vcd, "pik", "Bus") == [f"Read 3h: {count:04X}h", f"Read 9h: {seq:04X}h"]
    assert decoded(vcd, "pik", "Latch")[0].startswith("10.000")


@NEEDS_SIGROK
def test_cycles_of_a_pmka_on_its_bus_are_those_of_the_host(tmp_path: Path) -> None:
    vcd = tmp_path / "run.vcd"
    with stepped(vcd, "{name: a, board: pmka}") as control:
        control.call("run", for_s=0.02)
        want = []
        for address in range(10):
            data = read_register(control, address, strobe_ns=200 + 10 * address)
            want.append(f"Read {address:X}h: {data:04X}h")
        control.call("bus.write", unit="a", address=0xD, data=0)
        control.call("run", for_s=0.01)
    assert [*want, "Write Dh: 0000h"] == decoded(vcd, "pmka", "Bus")
    assert [text.split()[0][:5] for text in decoded(vcd, "pmka", "Samples")][:4] == ["100.0", "100.0", "100.0", "4.500"]


@NEEDS_SIGROK
@pytest.mark.parametrize(("length_ns", "warnings"), [(190, ["Strobe: 190 ns, not 200"]), (200, [])])
def test_a_strobe_that_is_too_short_is_told(length_ns: int, warnings: list[str], tmp_path: Path) -> None:
    idle = dict.fromkeys(PARALLEL_BUS, 0) | {"CS": 1}
    edges = [(1000, "CS", 0), (1000, "AB3", 1), (1000, "D15", 1), (1000 + length_ns, "CS", 1)]
    vcd = write(tmp_path / "b.vcd", idle, edges, 3000)
    assert decoded(vcd, "pmka", "Bus") == ["Write 8h: 8000h", *warnings]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([], "expected a VCD file, --decoders or --wireshark, got none"),
        (["nothing.vcd"], "nothing.vcd: expected a VCD file, got no such file"),
        ([__file__], "expected a VCD file with a scope and wires"),
        (["--decoders", "--dir", "/proc/x"], "/proc/x"),
        (["--wireshark", "--dir", "/proc/x"], "/proc/x"),
        (["--wireshark", "--decoders"], "--decoders: expected one of it and --wireshark, got both"),
    ],
)
def test_waveform_says_what_is_wrong(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["waveform", *words]) == 2
    assert text in capsys.readouterr().err
