"""Ring capture through the control socket: before and after the trigger beside a recording of the same run, memory."""

from __future__ import annotations

import itertools
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from psabench.emulator import Emulator
from psabench.errors import ControlError
from psabench.link.control import Control
from psabench.link.vcd import Vcd, read_vcd

LINES = ("Int", "Data", "CLK", "SClk", "DRD_A", "DOutX")
MS = 1_000_000


@contextmanager
def bench(*extra: str | Path) -> Iterator[tuple[Emulator, Control]]:
    with (
        Emulator("stream", cans=["none"], seed=2, extra=["--quiet", *extra]) as emu,
        Control(emu.directory / "control") as control,
    ):
        control.call("run", for_s=0.25)
        yield emu, control


def captures(control: Control) -> list[dict[str, Any]]:
    files: list[dict[str, Any]] = control.call("probe.captures").result["captures"]
    return files


def state(control: Control) -> str:
    return str(control.call("probe.captures").result["state"])


def same_window(whole: Vcd, part: Vcd, file: dict[str, Any]) -> None:
    """The capture has the edges of the recording between its ends, and the levels before them."""
    start_ns, end_ns = file["from_ns"], file["end_ns"]
    assert part.window(LINES, start_ns + 1, end_ns) == whole.window(LINES, start_ns + 1, end_ns)
    assert len(part.edges(LINES, start_ns + 1, end_ns)) > 100
    assert (part.wires["Int"].t_ns[0], part.end_ns) >= (start_ns, end_ns)


def test_a_fault_has_its_first_edges_in_the_file_and_what_was_before_them(tmp_path: Path) -> None:
    whole, part = tmp_path / "whole.vcd", tmp_path / "part.vcd"
    with bench("--vcd", whole, "--vcd-unit", "1") as (_, control):
        control.call("probe.arm", on="fault", path=str(part), pre_s=0.003, post_s=0.002)
        control.call("run", for_s=0.02)
        assert (state(control), captures(control), part.exists()) == ("armed", [], False)
        # INT stays low from the middle of a millisecond on, when it would be high
        control.call("fault.add", kind="line.stuck", point="a.line.Int", level="low", at_s=0.2805)
        control.call("run", for_s=0.02)
        (file,) = captures(control)
        assert state(control) == "off"
    assert file["trigger_ns"] == 280_500_000
    assert (file["from_ns"], file["end_ns"]) == (277_500_000, 282_500_000)
    assert file["lost"] == 0
    recorded, captured = read_vcd(whole), read_vcd(part)
    same_window(recorded, captured, file)
    falls = captured.wires["Int"].edges_ns(0)
    assert falls[-1] == file["trigger_ns"], "the fault's own edge"
    assert sum(file["from_ns"] < t < file["trigger_ns"] for t in falls) == 3, "frames before it, one per ms"
    assert captured.edges(["CLK"], file["trigger_ns"], file["end_ns"]), "and lines go on after it"


@pytest.mark.parametrize(
    ("on", "more", "first_level"),
    [("event:INT_FALL", {"count": 3}, 0), ("line:Int:falling", {}, 0), ("line:Int:rising", {}, 1)],
)
def test_events_and_lines_trigger_again_and_again(
    on: str, more: dict[str, int], first_level: int, tmp_path: Path
) -> None:
    whole, path = tmp_path / "whole.vcd", tmp_path / "c.vcd"
    with bench("--vcd", whole, "--vcd-unit", "1") as (_, control):
        control.call("probe.arm", on=on, path=str(path), pre_s=0.001, post_s=0.0015, files=3, **more)
        control.call("run", for_s=0.05)
        files = captures(control)
        assert state(control) == "off"
    assert [Path(f["path"]).name for f in files] == ["c-1.vcd", "c-2.vcd", "c-3.vcd"]
    recorded = read_vcd(whole)
    edges = set(recorded.wires["Int"].edges_ns(first_level).tolist())
    for f in files:
        assert f["trigger_ns"] in edges
        same_window(recorded, read_vcd(Path(f["path"])), f)
    apart = [b["trigger_ns"] - a["trigger_ns"] for a, b in itertools.pairwise(files)]
    assert min(apart) >= 1.5 * MS
    assert not path.exists()


def test_a_fault_of_another_kind_or_one_that_ends_is_no_trigger(tmp_path: Path) -> None:
    path = tmp_path / "c.vcd"
    with bench() as (_, control):
        control.call("fault.add", kind="line.stuck", point="a.line.Data", level="low", for_s=0.002)
        control.call("probe.arm", on="fault:line.stuck", path=str(path))  # one that ends is no beginning
        control.call("fault.add", kind="sensor.bias", point="a.sensor.x", bias_v=0.1)
        control.call("run", for_s=0.02)
        assert (state(control), path.exists()) == ("armed", False)
        control.call("fault.add", kind="line.stuck", point="a.line.Int", level="high")
        control.call("run", for_s=0.005)
        assert state(control) == "writing"
        control.call("probe.disarm")  # the file ends where it is
        (file,) = captures(control)
    assert file["end_ns"] == 275 * MS - 200_000
    assert read_vcd(path).end_ns >= file["end_ns"]


def test_a_long_capture_needs_no_more_memory_than_its_ring(tmp_path: Path) -> None:
    path = tmp_path / "long.vcd"

    def peak_kb(emu: Emulator) -> int:
        status = Path(f"/proc/{emu.pid}/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0])

    with bench() as (emu, control):
        control.call("probe.arm", on="line:Int:falling", path=str(path), pre_s=10, post_s=3600, ring_mb=1)
        control.call("run", for_s=0.5)
        before_kb = peak_kb(emu)
        control.call("run", for_s=5)
        assert peak_kb(emu) - before_kb < 1000
        control.call("probe.disarm")
        (file,) = captures(control)
        assert (file["lost"], "error" in file) == (0, False)
        assert file["bytes"] == path.stat().st_size > 10 * before_kb
    assert path.read_bytes()[-20:].count(b"#") >= 1


def test_a_ring_too_small_for_the_pre_trigger_says_where_the_file_begins(tmp_path: Path) -> None:
    with bench() as (_, control):
        control.call("probe.arm", on="event:DRD_A", count=20, path=str(tmp_path / "c.vcd"), pre_s=60, ring_mb=0.1)
        control.call("run", for_s=0.2)
        (file,) = captures(control)
    assert 250 * MS < file["from_ns"] < file["trigger_ns"]
    assert read_vcd(Path(file["path"])).wires["Int"].t_ns[0] >= file["from_ns"]


def test_a_full_disk_ends_the_file_and_not_the_run(tmp_path: Path) -> None:
    path = tmp_path / "c.vcd"
    with bench() as (emu, control):
        control.call("probe.arm", on="event:INT_FALL", path=str(path), post_s=10)
        # as a full disk: a write beyond the limit fails
        resource.prlimit(emu.pid, resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
        control.call("run", for_s=1)
        (file,) = captures(control)
        assert file["error"] == "File too large"
        assert state(control) == "off"
        assert f"capture {path}: File too large; the run continues\n" in emu.messages()
        assert emu.stop() == 3
    assert path.stat().st_size <= 1_000_000
    assert path.read_bytes().endswith(b"\n"), "whole lines"
    assert read_vcd(path).end_ns > 250 * MS


def test_a_folder_that_has_gone_ends_the_capture_and_not_the_run(tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    with bench() as (emu, control):
        control.call("probe.arm", on="event:INT_FALL", path=str(folder / "c.vcd"))
        folder.rmdir()
        control.call("run", for_s=0.1)
        (file,) = captures(control)
        assert (file["path"], file["error"]) == (
            str(folder / "c.vcd"),
            "expected a path that can be written, got no such folder",
        )
        assert state(control) == "off"
        assert f"capture {file['path']}: {file['error']}; the run continues\n" in emu.messages()
        assert emu.stop() == 3


def test_a_file_ends_at_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "c.vcd"
    with bench() as (emu, control):
        control.call("probe.arm", on="event:INT_FALL", path=str(path), post_s=10, limit_mb=0.5)
        control.call("run", for_s=1)
        (file,) = captures(control)
        assert file["error"] == "its limit of 0.5 MB is reached"
        assert emu.stop() == 0
    assert path.stat().st_size <= 500_000


def test_what_cannot_be_armed_is_rejected(tmp_path: Path) -> None:
    good = {"on": "fault", "path": str(tmp_path / "c.vcd")}
    rows: list[tuple[dict[str, Any], str]] = [
        ({"on": "faults"}, "on: expected fault[:KIND], event:NAME or line:NAME:rising|falling|edge|high|low, got"),
        ({"on": "event:NIX"}, "on: expected an event of a, a PSA-2: RES"),
        ({"on": "line:Nix:high"}, "on: expected a line of a PSA-2: SYNC_A"),
        ({"on": "fault:nix"}, "on: expected a kind of fault that fault.kinds lists, got"),
        ({"on": "line:Int:high", "count": 2}, "count: expected no count with a line"),
        ({"pre_s": 61}, "pre_s: expected"),
        ({"path": str(tmp_path)}, "expected a regular file or none, got another kind of file"),
        ({"path": str(tmp_path / "none" / "c.vcd")}, "expected a path that can be written, got no such folder"),
        ({"path": "/dev/full"}, "expected a regular file or none"),
    ]
    with bench() as (_, control):
        for more, text in rows:
            with pytest.raises(ControlError) as why:
                control.call("probe.arm", **{**good, **more})
            assert text in str(why.value)
        with pytest.raises(ControlError, match="expected an armed capture"):
            control.call("probe.disarm")
        control.call("probe.arm", **good)
        with pytest.raises(ControlError, match="expected no armed capture, got one"):
            control.call("probe.arm", **good)
        control.call("probe.disarm")
    assert os.listdir(tmp_path) == []
