"""A bench that is saved, restored or doubled goes on as if nothing had been: lines, frames, truth to the last bit."""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import can
import pytest
from psabench.emulator import Emulator
from psabench.errors import BadInput, ControlError
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from rig import BENCH, HERE, SEED, TIMEOUT_S, bus_spec, one_line, psa_emu, until

pytestmark = pytest.mark.host

NOISY = "stream"
INSTANTS = 100  # at which a busy bench is saved
SPAN_NS = 12_000_000  # of simulated time that is compared after each
SETUP_NS = 270_000_000  # of a board: a fifth of the deeds come before it is over
TRACE_LAG_NS = 200_000  # emu/trace/trace.h
TRUTH_EVERY = "1ms"

Frame = tuple[int, int, bytes]  # time stamp in ns, identifier, data


@dataclass(slots=True)
class Desk:
    """A host at an emulator in step pace: sends, commands, hears."""

    host: CanHost
    control: Control
    frames: list[Frame] = field(default_factory=list)
    t_ns: int = 0

    def run(self, dwell_ns: int) -> None:
        self.host.advance(dwell_ns * 1e-9)
        self.t_ns = self.control.call("time").t_ns


@contextmanager
def desk(control_path: Path, spec: str) -> Iterator[Desk]:
    with ExitStack() as stack:
        control = stack.enter_context(Control(control_path))
        host = stack.enter_context(CanHost(open_bus(spec), WallClock()))
        host.clock = StepClock(control)
        d = Desk(host, control)

        def hear(m: can.Message) -> None:
            d.frames.append((round(m.timestamp * 1e9), m.arbitration_id, bytes(m.data)))

        host.listeners.append(hear)
        d.t_ns = control.call("time").t_ns
        yield d


@contextmanager
def at(emulator: Emulator) -> Iterator[Desk]:
    assert emulator.control_path is not None
    with desk(emulator.control_path, bus_spec(emulator.endpoints[0])) as d:
        yield d


Deed = Callable[[Desk], None]


def deeds(seed: int, count: int) -> list[tuple[int, Deed]]:
    """What a busy host does, and how long it waits before each, in ns: the same for the same seed."""
    r = random.Random(seed)

    def ask(d: Desk, sub: int) -> None:
        d.host.send(0x605, bytes([0x40, 0x18, 0x10, sub, 0, 0, 0, 0]))

    def write_form(d: Desk, value: int) -> None:
        d.host.send(0x605, bytes([0x2F, 0x20, 0x20, 0, value, 0, 0, 0]))

    def sync(d: Desk, n: int) -> None:
        for _ in range(n):
            d.host.send(0x080, b"")

    def turn(d: Desk, angle_deg: float) -> None:
        if d.control.call("head.read").result["at_rest"]:
            d.control.call("head.turn", angle_deg=angle_deg)

    def reset(d: Desk, _: float) -> None:
        d.control.call("unit.reset", unit="a")

    def start(d: Desk, _: float) -> None:
        d.host.send(0x000, bytes([1, 0]))

    plan: list[tuple[int, Deed]] = []
    for i in range(count):
        wait_ns = r.choice((0, 1, r.randrange(200_000), r.randrange(3_000_000), r.randrange(25_000_000)))
        wait_ns += SETUP_NS if i == count // 5 else 0
        kind = r.choices((ask, write_form, sync, turn, reset, start), (8, 1, 4, 4, 0.2, 2))[0]
        number = {ask: r.randrange(1, 5), write_form: r.randrange(2), sync: r.randrange(1, 20)}.get(
            kind, r.uniform(0, 359)
        )
        plan.append((wait_ns, lambda d, kind=kind, number=number: kind(d, number)))  # type: ignore[misc]
    return plan


def edges(path: Path, after_ns: int, until_ns: int) -> tuple[dict[str, str], list[tuple[int, str]]]:
    """Levels of a VCD's lines at an instant, and the changes after it.

    A byte's edges are known when it ends: what a run ends with may lack those of its last one.
    """
    levels: dict[str, str] = {}
    changes: list[tuple[int, str]] = []
    t_ns = 0
    for line in path.read_text().partition("$enddefinitions $end\n")[2].splitlines():
        if line.startswith("#"):
            t_ns = int(line[1:])
        elif line[0] in "01" and t_ns <= after_ns:
            levels[line[1:]] = line[0]
        elif line[0] in "01" and t_ns <= until_ns - TRACE_LAG_NS:
            changes.append((t_ns, line))
    return levels, changes


def truth_lines(path: Path, after_ns: int, until_ns: int) -> list[str]:
    lines = path.read_text().splitlines()
    return [x for x in lines if after_ns < json.loads(x)["t_ns"] <= until_ns]


def heard(frames: list[Frame], after_ns: int, until_ns: int) -> list[Frame]:
    """Stamps are whole microseconds: what ends in the first one is left out."""
    return [f for f in frames if after_ns + 1000 < f[0] <= until_ns]


def watching(folder: Path, name: str) -> tuple[str | Path, ...]:
    vcd, truth = folder / f"{name}.vcd", folder / f"{name}.truth"
    return "--vcd", vcd, "--vcd-unit", "1", "--truth-log", truth, "--truth-every", TRUTH_EVERY


def go_on(d: Desk, plan: list[tuple[int, Deed]], until_ns: int) -> None:
    for wait_ns, deed in plan:
        if d.t_ns + wait_ns > until_ns:
            break
        d.run(wait_ns)
        deed(d)
    d.run(max(0, until_ns - d.t_ns))


@pytest.mark.parametrize(("scenario", "instants"), [(NOISY, INSTANTS), (HERE / "moving.yaml", INSTANTS // 4)])
def test_what_is_restored_at_any_instant_goes_on_as_the_original_did(
    tmp_path: Path, scenario: str | Path, instants: int
) -> None:
    """Lines, frames and truth after each of so many snapshots, with a host that does the same again."""
    plan = deeds(SEED, instants + 40)
    saved: list[int] = []
    with Emulator(scenario, extra=watching(tmp_path, "original")) as emulator, at(emulator) as original:
        for i, (wait_ns, deed) in enumerate(plan):
            original.run(wait_ns)
            if i < instants:
                original.control.call("snapshot", path=str(tmp_path / f"{i}.snapshot"))
                saved.append(original.t_ns)
            deed(original)
        end_ns = original.t_ns
    for i, t_ns in enumerate(saved):
        extra = ("--restore", tmp_path / f"{i}.snapshot", *watching(tmp_path, "restored"))
        until_ns = min(t_ns + SPAN_NS, end_ns)
        with Emulator(extra=extra) as emulator, at(emulator) as restored:
            assert restored.t_ns == t_ns
            go_on(restored, [(0, plan[i][1]), *plan[i + 1 :]], until_ns)
        span = (t_ns, until_ns)
        assert heard(restored.frames, *span) == heard(original.frames, *span), f"frames after {i}, TEST_SEED={SEED}"
        for kind in (edges, truth_lines):
            name = "vcd" if kind is edges else "truth"
            again, first = (kind(tmp_path / f"{x}.{name}", *span) for x in ("restored", "original"))
            assert again == first, f"{name} after {i} at {t_ns} ns, TEST_SEED={SEED}"
    assert len(heard(original.frames, 0, end_ns)) > 200
    assert saved[0] < SETUP_NS < saved[-1]


def test_a_restored_bench_can_be_saved_again(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    with Emulator(NOISY) as emulator, at(emulator) as d:
        go_on(d, deeds(SEED + 1, 8), 100_000_000)
        d.control.call("snapshot", path=str(first))
    with Emulator(extra=("--restore", first)) as emulator, at(emulator) as d:
        d.control.call("snapshot", path=str(second))
        last = [json.loads(x) for x in second.read_text().splitlines()]
    assert last[-2]["state"] == json.loads(first.read_text().splitlines()[-2])["state"]
    with Emulator(extra=("--restore", second)) as emulator, at(emulator) as d:
        assert d.t_ns == 100_000_000


def test_the_order_of_two_programs_at_one_instant_is_kept(tmp_path: Path) -> None:
    """The first one's frame is on the wire, at the instant at which the second one sends a frame that would win."""
    snapshot = tmp_path / "snapshot"
    with Emulator(BENCH) as emulator, at(emulator) as first, at(emulator) as second:
        first.run(5_000_000)
        clock = StepClock(first.control, [first.host, second.host])
        first.host.send(0x605, bytes([0x40, 0x18, 0x10, 1, 0, 0, 0, 0]))
        clock.command(None, "run", for_s=0)
        second.host.send(0x080, b"")
        clock.command(None, "run", for_s=1e-3)
        first.control.call("snapshot", path=str(snapshot))
    with Emulator(extra=("--restore", snapshot)) as emulator, at(emulator) as d:
        assert d.t_ns == 6_000_000


def seal(text: str) -> str:
    """A snapshot's text with the sum that fits."""
    return text + json.dumps({"sha256": hashlib.sha256(text.encode()).hexdigest()}, separators=(",", ":")) + "\n"


def make_snapshot(path: Path) -> str:
    """One of a bench that a host has asked for a register; its text without the sum."""
    with Emulator(BENCH) as emulator, at(emulator) as d:
        d.run(5_000_000)
        d.host.send(0x605, bytes([0x40, 0x18, 0x10, 1, 0, 0, 0, 0]))
        d.run(5_000_000)
        d.control.call("head.turn", angle_deg=12.5)
        d.run(5_000_000)
        d.control.call("snapshot", path=str(path))
    return "".join(path.read_text().splitlines(keepends=True)[:-1])


BAD_FILES: list[tuple[str, Callable[[str], str], str]] = [
    ("nothing", lambda t: "", "expected a snapshot of psa-emu, got another file"),
    ("a scenario", lambda t: "seed: 1\nunits: [{name: a}]\n", "expected a snapshot of psa-emu, got another file"),
    ("another version", lambda t: seal(t.replace('"version":"', '"version":"9', 1)), "got version 9"),
    ("another format", lambda t: seal(t.replace('"format":1', '"format":2', 1)), "and format 2"),
    ("one bit", lambda t: seal(t).replace("12.5", "12.4", 1), "the file is damaged"),
    ("half", lambda t: seal(t)[: len(t) // 2], "the file is damaged"),
    ("another frame", lambda t: seal(t.replace("4018100100", "4018100300", 1)), "replay ends in another state"),
    ("another angle", lambda t: seal(t.replace("12.5", "12.50001", 1)), "replay ends in another state"),
    ("another seed", lambda t: seal(t.replace('"seed":1', '"seed":2', 1)), "replay ends in another state"),
    ("no such command", lambda t: seal(t.replace("head.turn", "head.tern", 1)), "a command that changes the bench"),
    ("a file written", lambda t: seal(t.replace("head.turn", "snapshot", 1)), "a command that changes the bench"),
    ("out of range", lambda t: seal(t.replace("12.5", "1e9", 1)), "head.turn: angle_deg"),
    ("no such bus", lambda t: seal(t.replace('"bus":0', '"bus":5', 1)), "a bus of the scenario, got 5"),
    ("a stranger", lambda t: seal(t.replace('"from":1', '"from":7', 1)), "client 7 is not on the bus"),
    ("an entry less", lambda t: seal(re.sub('.*"from".*\n', "", t)), "as many entries as its head says"),
]  # fmt: skip


def test_files_that_cannot_be_done_again_are_refused_in_one_line(tmp_path: Path) -> None:
    text = make_snapshot(tmp_path / "good")
    assert seal(text) == (tmp_path / "good").read_text()
    bad = tmp_path / "bad"
    for what, spoil, why in BAD_FILES:
        bad.write_text(spoil(text))
        done = psa_emu("--restore", bad, "--can", "none", "--pace", "free", "--for", "1ms")
        assert done.returncode == 2, what
        assert one_line(done.stderr, "psa-emu").startswith(f"psa-emu: {bad}: "), what
        assert why in done.stderr, (what, done.stderr)
        assert not done.stdout, what
    done = psa_emu("--restore", tmp_path / "missing", "--can", "none")
    assert done.returncode == 2
    assert "missing: expected a snapshot, got no such file" in one_line(done.stderr, "psa-emu")


def test_a_snapshot_that_cannot_be_written_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with Emulator(BENCH) as emulator, at(emulator) as d:
        for path in (tmp_path / "no" / "folder", tmp_path):
            with pytest.raises(ControlError, match=path.name):
                d.control.call("snapshot", path=str(path))
        d.run(1_000_000)
    assert not list(tmp_path.glob("**/*"))


def test_a_snapshot_replaces_files_and_nothing_else(tmp_path: Path) -> None:
    pipe, link, file = tmp_path / "pipe", tmp_path / "link", tmp_path / "file"
    os.mkfifo(pipe)
    file.write_text("old")
    link.symlink_to(file)
    with Emulator(BENCH) as emulator, at(emulator) as d:
        for path in (pipe, link):
            with pytest.raises(ControlError, match="expected a file or a new name"):
                d.control.call("snapshot", path=str(path))
        assert pipe.is_fifo()
        assert link.is_symlink()
        assert file.read_text() == "old"
        d.control.call("snapshot", path=str(file))
    assert file.read_text().startswith('{"psabench":"snapshot"')


def test_restore_takes_nothing_that_the_snapshot_fixes(tmp_path: Path) -> None:
    for extra in (["--seed", "2"], ["--start"], ["quiet"], ["--bitrate", "0"]):
        done = psa_emu("--restore", tmp_path / "x", *extra)
        assert done.returncode == 2
        assert "the snapshot has them" in one_line(done.stderr, "psa-emu")
    with pytest.raises(BadInput):
        Emulator(extra=("--restore", tmp_path / "x")).__enter__()


# ---- fork


def test_parent_and_child_go_on_alike_and_apart(tmp_path: Path) -> None:
    """The child hears what the parent hears when both hosts do the same; the parent's files are as without a child."""
    plan = deeds(SEED + 2, 60)
    vcd, alone = tmp_path / "parent.vcd", tmp_path / "alone.vcd"
    child_control, child_truth = tmp_path / "control", tmp_path / "truth"
    with Emulator(NOISY, extra=("--vcd", vcd, "--line", tmp_path / "line")) as emulator, at(emulator) as parent:
        go_on(parent, plan[:30], 330_000_000)
        t_ns = parent.t_ns
        parent.host.send(0x605, bytes([0x40, 0x18, 0x10, 1, 0, 0, 0, 0]))  # still on its way
        parent.run(0)
        made = parent.control.call(
            "fork", control=str(child_control), can="socketcand:0 slcan", truth=str(child_truth)
        ).result
        assert [e.get("can") for e in made["endpoints"]][:2] == ["socketcand", "slcan"]
        with desk(child_control, bus_spec(made["endpoints"][0])) as child:
            assert child.t_ns == t_ns
            assert child.control.call("units").result == parent.control.call("units").result
            go_on(child, plan[30:], 400_000_000)
            assert parent.control.call("time").t_ns == t_ns  # the parent's time stands still
            child.control.call("head.turn", angle_deg=77)
            go_on(parent, plan[30:], 400_000_000)
            assert heard(child.frames, t_ns, 400_000_000) == heard(parent.frames, t_ns, 400_000_000)
            assert len(heard(child.frames, t_ns, 400_000_000)) > 50
            child.control.call("quit")
        until(lambda: not child_control.exists() and not child_truth.exists(), "the child to leave")
        assert (tmp_path / "line").is_symlink()
    with Emulator(NOISY, extra=("--vcd", alone)) as emulator, at(emulator) as d:
        go_on(d, plan[:30], 330_000_000)
        d.host.send(0x605, bytes([0x40, 0x18, 0x10, 1, 0, 0, 0, 0]))
        d.run(0)
        go_on(d, plan[30:], 400_000_000)
    assert vcd.read_bytes() == alone.read_bytes()


def test_a_child_is_saved_restored_and_forked_like_any_bench(tmp_path: Path) -> None:
    with Emulator(NOISY) as emulator, at(emulator) as parent:
        parent.run(20_000_000)
        first = parent.control.call("fork", control=str(tmp_path / "c1"), can="socketcand:0").result
        with desk(tmp_path / "c1", bus_spec(first["endpoints"][0])) as child:
            child.run(10_000_000)
            second = child.control.call("fork", control=str(tmp_path / "c2")).result
            child.control.call("snapshot", path=str(tmp_path / "snapshot"))
            with Control(tmp_path / "c2") as grandchild:
                assert grandchild.call("time").t_ns == 30_000_000
                grandchild.call("quit")
            child.control.call("quit")
        assert len({emulator.pid, first["pid"], second["pid"]}) == 3
    with Emulator(extra=("--restore", tmp_path / "snapshot")) as emulator, at(emulator) as again:
        assert again.t_ns == 30_000_000


def test_a_fork_that_cannot_have_its_endpoints_is_refused(tmp_path: Path) -> None:
    with Emulator(BENCH) as emulator, at(emulator) as d:
        path = emulator.control_path
        for args, why in (
            ({"control": str(path)}, "expected a free path, got one that another process uses"),
            ({"control": str(tmp_path / "c"), "can": "carrier"}, '--can: expected .*, got "carrier"'),
            ({"control": str(tmp_path / "no" / "c")}, "expected a path that can be written, got no such folder"),
        ):
            with pytest.raises(ControlError, match=why):
                d.control.call("fork", **args)
        d.run(1_000_000)
        assert d.t_ns == 1_000_000
        assert path is not None
        assert path.is_socket()


def test_a_child_outlives_its_parent(tmp_path: Path) -> None:
    with Emulator(NOISY) as emulator, at(emulator) as parent:
        parent.run(5_000_000)
        parent.control.call("fork", control=str(tmp_path / "c"))
    with Control(tmp_path / "c") as child:
        assert child.call("run", for_s=0.01).t_ns == 15_000_000
        child.call("quit")
    until(lambda: not (tmp_path / "c").exists(), "the child to leave", TIMEOUT_S)
