"""Int, Data and CLK of PSA-2 as pairs: wires A and B, receivers' delay and skew, open and swapped wires."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from psabench.conform.probes import PortProbe
from psabench.emulator import Emulator
from psabench.errors import ControlError
from psabench.link.control import Control
from psabench.link.lineport import LineDecoder
from psabench.link.signals import Ints
from psabench.link.vcd import Vcd, read_vcd
from psabench.places import find_emulator

PAIRS = ("Int", "Data", "CLK")
SETUP_S, RUN_S = 0.2, 0.02


def scenario(folder: Path, **profile: object) -> Path:
    path = folder / "bench.yaml"
    path.write_text(json.dumps({"units": [{"name": "a", "board": "psa2", "profile_set": profile}]}), encoding="utf-8")
    return path


def recorded(folder: Path, *options: str, **profile: object) -> Vcd:
    """The set-up and some frames."""
    out = folder / "run.vcd"
    argv = [str(find_emulator()), str(scenario(folder, **profile)), "--can", "none", "--pace", "free", "--for", "220ms"]
    subprocess.run([*argv, "--quiet", "--vcd-unit", "1", "--vcd", str(out), *options], check=True, capture_output=True)
    return read_vcd(out)


def edges(v: Vcd, name: str, level: int) -> Ints:
    return v.wires[name].edges_ns(level)


def test_b_is_the_inverse_of_a_and_no_other_line_changes(tmp_path: Path) -> None:
    plain, wires = recorded(tmp_path), recorded(tmp_path, "--pairs")
    assert set(wires.wires) - set(plain.wires) == {f"{n}_{w}" for n in PAIRS for w in "AB"}
    for name, wire in plain.wires.items():
        assert np.array_equal(wire.t_ns, wires.wires[name].t_ns), name
    for name in PAIRS:
        a, b = wires.wires[f"{name}_A"], wires.wires[f"{name}_B"]
        assert len(a.t_ns) > 50
        assert np.array_equal(a.t_ns, b.t_ns)
        assert np.array_equal(a.level, 1 - b.level)
        assert np.array_equal(a.t_ns, plain.wires[name].t_ns)


def test_receivers_follow_after_delay_and_skew(tmp_path: Path) -> None:
    delay_ns, skew_ns = [24, 31, 19.6], 3  # to the nearest nanosecond
    v = recorded(tmp_path, "--pairs", line_delay_ns=delay_ns, line_skew_ns=skew_ns)
    for name, rise_ns in zip(PAIRS, delay_ns, strict=True):
        for level, due_ns in ((1, rise_ns), (0, rise_ns + skew_ns)):
            sent, came = edges(v, f"{name}_A", level), edges(v, name, level)
            assert len(sent) > 30
            assert set(came - sent[: len(came)]) == {round(due_ns)}, name


def test_without_wires_in_the_recording_delays_are_the_same(tmp_path: Path) -> None:
    late, wires = (recorded(tmp_path, *o, line_delay_ns=40) for o in ((), ("--pairs",)))
    prompt = recorded(tmp_path)
    for name in PAIRS:
        assert np.array_equal(late.wires[name].t_ns, wires.wires[name].t_ns)
        assert set(edges(late, name, 1) - edges(prompt, name, 1)) == {40}


def test_the_line_port_has_b_in_bits_3_to_5(tmp_path: Path) -> None:
    port = PortProbe(tmp_path / "line", "psa2")
    options: list[str | Path] = ["--quiet", "--line", port.path, "--pairs"]
    with (
        Emulator(scenario(tmp_path), cans=["none"], extra=options) as emu,
        Control(emu.directory / "control") as control,
    ):
        control.call("run", for_s=SETUP_S)
        port.start()
        control.call("run", for_s=RUN_S)
        port.stop()
    x = np.frombuffer(port.data, np.uint8)
    assert len(x) > 100_000
    assert (x & 7 ^ x >> 3 & 7 == 7).all()
    frames = LineDecoder().feed(port.data)
    assert len(frames.words) >= 15


@pytest.mark.parametrize("kind", ["line.open", "line.swapped"])
def test_wires_go_on_at_the_drivers(kind: str, tmp_path: Path) -> None:
    out = tmp_path / "fault.vcd"
    with Emulator(scenario(tmp_path), cans=["none"]) as emu, Control(emu.directory / "control") as control:
        control.call("run", for_s=SETUP_S)
        control.call("vcd.start", path=str(out), pairs=True)
        for name in PAIRS:
            control.call("fault.add", kind=kind, point=f"a.line.{name}")
        control.call("run", for_s=RUN_S)
        control.call("vcd.stop")
    v = read_vcd(out)
    for name in PAIRS:
        line, a, b = v.wires[name], v.wires[f"{name}_A"], v.wires[f"{name}_B"]
        assert len(a.t_ns) > 15
        assert np.array_equal(a.level, 1 - b.level)
        at_ns = np.unique(np.concatenate([line.t_ns, a.t_ns]))
        at_ns = at_ns[at_ns > v.start_ns]
        due = np.ones(len(at_ns)) if kind == "line.open" else b.at(at_ns)
        assert np.array_equal(line.at(at_ns), due), name


def test_a_board_without_pairs_cannot_record_them(tmp_path: Path) -> None:
    path = tmp_path / "pik.yaml"
    path.write_text("units: [{name: p, board: pik}]\n")
    with Emulator(path, cans=["none"]) as emu, Control(emu.directory / "control") as control:
        with pytest.raises(
            ControlError, match=r"pairs: expected a board with differential pairs \(psa2, bins\), got pik"
        ):
            control.call("vcd.start", path=str(tmp_path / "out.vcd"), pairs=True)
        assert not (tmp_path / "out.vcd").exists()
        control.call("vcd.start", path=str(tmp_path / "out.vcd"))


def test_a_line_without_a_pair_cannot_be_open(tmp_path: Path) -> None:
    with (
        Emulator(scenario(tmp_path), cans=["none"]) as emu,
        Control(emu.directory / "control") as control,
        pytest.raises(ControlError, match=r"line\.open: expected a line with wires A and B, got a\.line\.SClk"),
    ):
        control.call("fault.add", kind="line.open", point="a.line.SClk")
