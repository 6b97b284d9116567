"""Every board is a unit like any other: scenario, dump, lines, snapshot, fork, line port, bus port."""

from __future__ import annotations

import json
import os
import re
import select
import threading
from contextlib import suppress
from pathlib import Path
from types import TracebackType

import pytest
from psabench.emulator import Emulator
from psabench.errors import CycleRefused
from psabench.link.busport import BusPort
from psabench.link.control import Control
from rig import ROOT, bus_spec, one_line, psa_emu, until

from tests.e2e.bench.test_snapshot import Desk, at, desk, edges, heard, truth_lines, watching

pytestmark = pytest.mark.host

LIST = (ROOT / "emu/unit/boards.h").read_text(encoding="utf-8")
TYPES = re.findall(r"\bX\((\w+)\)", LIST.partition("#define BOARD_TYPES(X)")[2].partition("\n")[0])
ALIASES = dict(re.findall(r"\bX\((\w+), (\w+), ", LIST.partition("#define BOARD_ALIASES(X)")[2].partition("\n\n")[0]))
NAMES = {**{name: name for name in TYPES}, **ALIASES}  # what a scenario may say: the type
assert len(TYPES) >= 5, "emu/unit/boards.h: expected a list of boards"
assert ALIASES, "emu/unit/boards.h: expected a list of aliases"
ALL = sorted(NAMES)
LINE_BYTES = 190_000  # 0.1 s at 2 MHz, but for what is not known yet at its end
SETUP_S = 0.4  # of the slowest board
NO_INPUTS = ("gyro", "receiver")
PLATFORM = "site: {latitude_deg: 50}\nplatform: {}\n"  # what a gyro unit controls
GENTLE = "seed: 3\nhead: {turn_s: 0}\nunits:\n"
SENSORS = (
    "axes: {x: {sensor: mems, u0_v: 0.2, kx_v_per_g: 0.5, reading_noise_v: 1.0e-4}, y: {sensor: mems, kx_v_per_g: 0.5}}"
)


def scenario(folder: Path, *boards: str) -> Path:
    """One unit of each of these boards, on one bus."""
    path = folder / "boards.yaml"
    head = f"{PLATFORM}{GENTLE}" if "gyro" in boards else GENTLE
    sensors = {b: "" if b in NO_INPUTS else f"{SENSORS}, " for b in boards}
    path.write_text(head + "".join(f"  - {{name: {b}, {sensors[b]}board: {b}}}\n" for b in boards))
    return path


def dump(path: Path) -> dict[str, object]:
    done = psa_emu(path, "--dump")
    assert done.returncode == 0, done.stderr
    whole: dict[str, object] = json.loads(done.stdout)
    return whole


def node_of(path: Path) -> int:
    return int(json.loads(psa_emu(path, "--dump").stdout)["units"][0]["node"])


def buses_of(folder: Path) -> dict[str, bool]:
    """Which of the boards have a parallel bus, by what the emulator says."""
    found = {}
    for board in ALL:
        done = psa_emu(scenario(folder, board), "--bus-port", "-", "--can", "none", "--pace", "free", "--for", "0s")
        assert done.returncode in (0, 2), done.stderr
        found[board] = done.returncode == 0
    return found


# ---- scenario


@pytest.mark.parametrize("board", ALL)
def test_the_dump_of_a_board_is_the_same_bench_again(board: str, tmp_path: Path) -> None:
    path, again = scenario(tmp_path, board), tmp_path / "again.yaml"
    again.write_text(psa_emu(path, "--dump").stdout)
    assert psa_emu(again, "--dump").stdout == psa_emu(path, "--dump").stdout
    run = ["--pace", "free", "--for", "500ms", "--can", "none", "--quiet", "--start"]
    one, two = tmp_path / "one.vcd", tmp_path / "two.vcd"
    for source, vcd in ((path, one), (again, two)):
        done = psa_emu(source, *run, "--vcd", vcd)
        assert done.returncode == 0, done.stderr
    assert one.read_bytes() == two.read_bytes()
    assert f"$scope module {NAMES[board]} $end" in one.read_text()
    assert len(edges(one, 0, 500_000_000)[1]) > 20


def test_all_boards_stand_on_one_bench(tmp_path: Path) -> None:
    """Each with a node of its own by default, and all of them heard on the bus."""
    path = scenario(tmp_path, *ALL)
    units = json.loads(psa_emu(path, "--dump").stdout)["units"]
    nodes = {u["name"]: u["node"] for u in units}
    assert len(set(nodes.values())) == len(ALL)
    assert nodes["psa2"] == 6  # psa1 came before
    with Emulator(path) as emulator, at(emulator) as d:
        d.run(round(SETUP_S * 1e9))
        told = {u["name"]: u for u in d.control.call("units").result["units"]}
        assert {name: told[name]["board"] for name in ALL} == {name: NAMES[name] for name in ALL}
        assert all(u["ready"] for u in told.values()), told
        assert {0x700 + n for n in nodes.values()} <= {f[1] for f in d.frames}  # boot-up messages


def test_settings_that_a_board_has_not_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    for board in set(ALL) - {"psa1", "psa2"}:
        key, value = ("frame_form", "0") if board == "bins" else ("adc_chain", "exact")  # it has a PSA-2 inside
        path.write_text(f"units:\n  - board: {board}\n    {key}: {value}\n")
        done = psa_emu(path, "--dump")
        assert done.returncode == 2
        assert f"units.a.{key}: expected a key of a " in one_line(done.stderr, "psa-emu")
        assert f":3:{len(key) + 7}:" in done.stderr
        path.write_text(f"units:\n  - board: {board}\n    profile: article\n")
        done = psa_emu(path, "--dump")
        assert done.returncode == 2
        told = one_line(done.stderr, "psa-emu")
        assert "s.yaml:3:14: units.a.profile: expected a profile of " in told
        assert f" (board: {board}), got article, one of PSA-2 (board: psa2)" in told


# ---- snapshot and fork


def busy(d: Desk, node: int, unit: str, steps: int) -> None:
    """What a host does: start, look, turn the head, reset."""
    for i in range(steps):
        d.host.send(0x000, bytes([1, 0]))
        d.run(3_000_000)
        d.host.send(0x600 + node, bytes([0x40, 0x18, 0x10, 1 + i % 4, 0, 0, 0, 0]))
        d.run(17_000_000)
        d.control.call("head.turn", angle_deg=7.0 * i)
        d.run(1_234_567)
        if i == steps // 2:
            d.control.call("unit.reset", unit=unit)


@pytest.mark.parametrize("board", ALL)
def test_a_board_is_restored_and_goes_on_as_it_did(board: str, tmp_path: Path) -> None:
    path = scenario(tmp_path, board)
    node = node_of(path)
    saved: list[int] = []
    with Emulator(path, extra=watching(tmp_path, "original")) as emulator, at(emulator) as d:
        for i, before_ns in enumerate((7_000_000, 90_000_000, 333_333_333)):  # set-up, later, running
            d.run(before_ns)
            d.control.call("snapshot", path=str(tmp_path / f"{i}.snapshot"))
            saved.append(d.t_ns)
            busy(d, node, board, 4)
        frames = d.frames
    for i, t_ns in enumerate(saved):
        extra = ("--restore", tmp_path / f"{i}.snapshot", *watching(tmp_path, "restored"))
        with Emulator(extra=extra) as emulator, at(emulator) as d:
            assert d.t_ns == t_ns
            busy(d, node, board, 4)
            span = (t_ns, d.t_ns)
            assert heard(d.frames, *span) == heard(frames, *span)
            assert len(heard(d.frames, *span)) >= 4  # answers at least
        for kind, name in ((edges, "vcd"), (truth_lines, "truth")):
            first, again = (kind(tmp_path / f"{x}.{name}", *span) for x in ("original", "restored"))
            assert again == first, f"{name} after {i}"


@pytest.mark.parametrize("board", ALL)
def test_parent_and_child_go_on_alike(board: str, tmp_path: Path) -> None:
    path = scenario(tmp_path, board)
    node = node_of(path)
    control = tmp_path / "control"
    with Emulator(path, extra=("--vcd", tmp_path / "a.vcd")) as emulator, at(emulator) as parent:
        busy(parent, node, board, 6)
        t_ns = parent.t_ns
        made = parent.control.call("fork", control=str(control), can="socketcand:0").result
        with desk(control, bus_spec(made["endpoints"][0])) as child:
            for d in (parent, child):
                busy(d, node, board, 5)
            span = (t_ns, parent.t_ns)
            assert heard(child.frames, *span) == heard(parent.frames, *span)
            one, two = (d.control.call("counters").result["units"] for d in (parent, child))
            assert one == two
            child.control.call("quit")


# ---- ports


class Reader(threading.Thread):
    """Takes what comes out of a pty: in step pace time waits for whoever has it open."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.fd = os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        self.data = b""
        self.enough = threading.Event()

    def run(self) -> None:
        poll = select.poll()
        poll.register(self.fd, select.POLLIN)
        while not self.enough.is_set():
            if poll.poll(20):
                self.data += os.read(self.fd, 65536)

    def __enter__(self) -> Reader:
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, tb: TracebackType | None) -> None:
        self.enough.set()
        self.join()
        os.close(self.fd)


@pytest.mark.parametrize("board", ALL)
def test_the_line_port_samples_the_lines_of_the_board(board: str, tmp_path: Path) -> None:
    link = tmp_path / "line"
    with Emulator(scenario(tmp_path, board), extra=("--line", link, "--line-hz", "2000000")) as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            control.call("run", for_s=SETUP_S)
            with Reader(link) as reader:
                control.call("run", for_s=0.1)
                until(lambda: len(reader.data) >= LINE_BYTES, "the samples")
    data = reader.data
    assert len(set(data)) > 1, "no line moves"
    assert not any(b & 0x80 for b in set(data)), "samples were lost"


def test_a_bus_port_is_refused_where_there_is_no_bus(tmp_path: Path) -> None:
    for args, says in (
        (("-",), "--bus-port -: expected a scenario with a unit that has a parallel bus"),
        (("psa2:-",), "--bus-port psa2:-: expected a unit with a parallel bus, got psa2, a PSA-2"),
        (("b:-",), '--bus-port b:-: expected a unit of the scenario, got "b"'),
        (("psa2:",), "--bus-port: expected [UNIT:]LINK"),
    ):
        done = psa_emu(scenario(tmp_path, "psa2"), "--bus-port", *args, "--can", "none")
        assert done.returncode == 2
        assert says in one_line(done.stderr, "psa-emu")
    boards = [b for b, has in buses_of(tmp_path).items() if has]
    assert boards, "no board has a bus"
    done = psa_emu(scenario(tmp_path, boards[0]), "--bus-port", "-", "--bus-port", f"{boards[0]}:-", "--can", "none")
    assert done.returncode == 2
    assert f"expected one bus port per unit, got a second for {boards[0]}" in one_line(done.stderr, "psa-emu")


def talk(port: BusPort, control: Control) -> int:
    """Every address once; how many answered."""
    read = 0
    for address in port.who().names:
        with suppress(CycleRefused):  # write-only, or no word waits there now
            read += port.read(address).address == address
        control.call("run", for_s=1e-3)
    with pytest.raises(CycleRefused, match="nothing answers"):
        port.read(0xFE)
    return read


def test_cycles_of_the_bus_port_belong_to_the_bench(tmp_path: Path) -> None:
    """They are in snapshots, refused ones too; a restored bench and a child have bus ports of their own."""
    for board in (b for b, has in buses_of(tmp_path).items() if has):
        snapshot, link, control_path = tmp_path / "snapshot", tmp_path / "bus", tmp_path / "control"
        with Emulator(scenario(tmp_path, board), extra=("--bus-port", f"{board}:{link}")) as emulator:
            assert emulator.control_path is not None
            ready = emulator.endpoint(bus="pty")
            assert ready["unit"] == board
            assert ready["link"] == str(link)
            with Control(emulator.control_path) as control:
                control.call("run", for_s=SETUP_S)
                with BusPort(link, lambda s, c=control: c.call("run", for_s=s)) as port:  # type: ignore[misc]
                    assert port.who().board == NAMES[board]
                    assert talk(port, control) > 0
                    port.ask("R 0")  # perhaps under way still
                    control.call("snapshot", path=str(snapshot))
                    made = control.call("fork", control=str(control_path), can="none").result
                    assert talk_to_child(made, control_path) > 0
        assert '"cycle":254' in snapshot.read_text()
        with Emulator(extra=("--restore", snapshot, "--bus-port", link)) as emulator:
            assert emulator.control_path is not None
            with (
                Control(emulator.control_path) as control,
                BusPort(
                    emulator.endpoint(bus="pty")["pty"],
                    lambda s, c=control: c.call("run", for_s=s),  # type: ignore[misc]
                ) as port,
            ):
                assert talk(port, control) > 0


def talk_to_child(made: dict[str, object], control_path: Path) -> int:
    endpoints = made["endpoints"]
    assert isinstance(endpoints, list)
    pty = next(e for e in endpoints if e.get("bus") == "pty")
    assert "link" not in pty
    with Control(control_path) as control:
        with BusPort(pty["pty"], lambda s: control.call("run", for_s=s)) as port:
            read = talk(port, control)
        control.call("quit")
    return read
