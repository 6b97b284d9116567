"""`psabench.Bench`: the same script over every transport and with every address; time that moves only when told."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest
from psabench import Bench
from psabench.bench import NS
from psabench.boards.psa2.device import Psa2
from psabench.emulator import Emulator
from psabench.errors import BadInput, BenchError, ControlError, InstrumentError, TimeOut
from psabench.estimate.face import Face
from psabench.procedures.head_bench import Reading
from psabench.procedures.result import ProcedureResult
from psabench.procedures.turns import TurnsParams, turns
from psabench.procedures.wire_bench import WireBench
from rig import ADAPTERS, BENCH, HOST, TIMEOUT_S, addresses, over, psabench, until

EVERY = over("socketcand", "slcan", "vcan")
SHORT = TurnsParams(readings=2)


def calibrate(bench: Bench) -> ProcedureResult:
    """The script: it knows a unit and a head, and nothing of how they are reached."""
    return turns(WireBench(bench.unit, bench.head, average=4), SHORT)


def exactly(readings: tuple[Reading, ...]) -> list[tuple[object, ...]]:
    return [astuple(r) for r in readings]


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench.start(BENCH) as b:
        yield b


# ---- the same script everywhere


@EVERY
def test_in_lockstep_a_calibration_is_the_same_to_the_bit_over_every_transport(transport: str) -> None:
    with Bench.start("calibrate", can="socketcand:0") as b:
        want = calibrate(b)
    with Bench.start("calibrate", can=ADAPTERS[transport]) as b:
        got = calibrate(b)
    assert exactly(got.readings) == exactly(want.readings)
    assert [e.value for e in got.estimates] == [e.value for e in want.estimates]


@EVERY
def test_in_real_time_the_same_script_finds_the_same_sensor(transport: str) -> None:
    with Bench.start(BENCH, pace="wall", can=ADAPTERS[transport]) as b:
        got = calibrate(b)
        truth = next(iter(b.truth()["units"].values()))["axes"]["x"]
    for name in ("u0_v", "kx_v_per_g"):
        assert got.get(name).value == pytest.approx(truth[name], abs=2e-3), name


@HOST
def test_instruments_on_a_pty_are_the_instruments_on_tcp() -> None:
    with Bench.start("calibrate") as b:
        want = calibrate(b)
    extra = ["--scpi", "head:pty"]
    with Emulator("calibrate", pace="step", extra=extra) as emulator:
        e = emulator.endpoint(scpi="head")
        head = f"ASRL{e['pty']}::INSTR"
        can = emulator.endpoint(can="socketcand")
        spec = f"socketcand:{can['host']}:{can['port']}"
        with Bench.connect(spec, control=emulator.control_path, scpi={"head": head}) as b:
            got = calibrate(b)
    assert exactly(got.readings) == exactly(want.readings)


@HOST
def test_the_command_runs_on_a_bench_by_its_addresses(tmp_path: Path) -> None:
    with Emulator(BENCH, pace="step", truth=True, scpi=True) as emulator:
        where = addresses(emulator)
        truth = ("--truth", str(emulator.truth_path))
        with psabench("run", "turns", *where, *truth, "--average", "4", "--out", tmp_path) as run:
            out, err = run.communicate(timeout=TIMEOUT_S)
    assert run.returncode == 0, out + err
    section = json.loads((tmp_path / "result.json").read_text())["sections"][0]
    assert section["procedure"] == "turns"
    assert "numbers are within 2 U of the sensor's true parameters" in out


@HOST
def test_the_control_socket_of_an_emulator_tells_its_addresses(tmp_path: Path) -> None:
    with Emulator(BENCH, cans=["slcan", "socketcand:0"], pace="step", scpi=True) as emulator:
        port = emulator.endpoint(can="socketcand")["port"]
        with Bench.connect(control=emulator.control_path) as b:
            assert b.host.bus.channel_info.endswith(f"127.0.0.1:{port}")  # the pty has room for one: left to others
            b.unit.wait_ready()
            assert b.head.turn(30.0) == pytest.approx(30.0, abs=0.01)
        assert emulator.control_path
        with psabench("run", "turns", "--control", emulator.control_path, "--average", "4", "--out", tmp_path) as run:
            out, err = run.communicate(timeout=TIMEOUT_S)
    assert run.returncode == 0, out + err
    assert "report: " in out


@HOST
def test_an_emulator_without_an_instrument_says_so() -> None:
    with Emulator(BENCH, cans=["none"]) as emulator, Bench.connect(control=emulator.control_path) as b:
        assert b.hosts == {}
        with pytest.raises(BenchError, match="psa-emu was started without --scpi head, and no address was given"):
            _ = b.head


# ---- what is not there says why


@HOST
def test_a_bench_without_emulator_says_what_it_has_not() -> None:
    with (
        Emulator(BENCH, pace="wall") as emulator,
        Bench.connect(f"socketcand:127.0.0.1:{emulator.endpoint(can='socketcand')['port']}") as b,
    ):
        b.unit.wait_ready()
        assert b.unit.register("x", 1) == 0x56
        assert b.pace == "real"
        assert (b.status().late, b.status().temp_degc) == (None, None)
        for name in ("head", "table", "chamber", "supply"):
            with pytest.raises(BenchError, match=f"bench: no {name}: no address was given for it"):
                getattr(b, name)
        for what in (lambda: b.faults.list(), lambda: b.probe.lines(), lambda: b.snapshot("x"), lambda: b.fork()):
            with pytest.raises(BenchError, match="bench: no control socket; start psa-emu with --control"):
                what()
        with pytest.raises(BenchError, match="no truth port"):
            b.truth()


@HOST
def test_an_address_for_what_is_no_instrument_is_bad_input() -> None:
    with pytest.raises(BadInput, match="scpi: expected head, table, chamber, supply, got oven"):
        Bench.connect("none", scpi={"oven": "TCPIP::127.0.0.1::1::SOCKET"})


@HOST
def test_a_bench_without_bus_has_no_unit() -> None:
    with Emulator(BENCH, pace="step") as emulator, Bench.connect("none", control=emulator.control_path) as b:
        assert b.units == {}
        b.run_for(0.5)
        assert b.time_s == 0.5
        with pytest.raises(BenchError, match="no unit"):
            _ = b.unit
        with pytest.raises(BenchError, match="without a CAN bus"):
            _ = b.host


@HOST
def test_what_the_head_refuses_is_raised_where_it_was_asked(bench: Bench) -> None:
    with pytest.raises(InstrumentError, match="head: ANGL 1000000") as refused:
        bench.head.turn(1e6)
    assert refused.value.number == -222
    assert bench.head.turn(30.0) == pytest.approx(30.0, abs=1e-12)
    assert bench.head.mount(Face.REVERSED) == bench.head.angle_deg
    assert bench.head.face is Face.REVERSED
    assert bench.head.identity.startswith("psabench,")


# ---- time


@HOST
def test_time_moves_only_when_the_host_says_so(bench: Bench) -> None:
    assert bench.time_s == 0.0
    bench.run_for(2.25)  # in slices, of which no one sees anything
    assert bench.time_s == 2.25
    assert bench.control.call("time").t_ns == round(2.25 * NS)
    bench.head.turn(10.0)
    bench.probe.lines()
    assert bench.control.call("time").t_ns == round(2.25 * NS)
    bench.wait(0.0004)
    assert bench.step() == pytest.approx(2.251, abs=1e-12)
    assert bench.step(3) == pytest.approx(2.254, abs=1e-12)


@HOST
def test_a_run_ends_at_the_very_event(bench: Bench) -> None:
    bench.unit.wait_ready()
    first_s = bench.run_until("DRD_A")
    assert bench.run_until("DRD_A", count=5) - first_s == pytest.approx(5e-3, abs=2e-9)
    assert bench.run_until("INT_FALL", unit="a") > first_s
    assert bench.probe.lines()["Int"] == 0  # the first look
    with pytest.raises(TimeOut, match=r"POWER_DOWN: expected 1 within 0\.01 s, got 0"):
        bench.run_until("POWER_DOWN", limit_s=0.01)
    with pytest.raises(ControlError, match="NO_SUCH"):
        bench.run_until("NO_SUCH")


@HOST
def test_in_real_time_an_event_is_waited_for() -> None:
    with Bench.start(BENCH, pace="wall") as b:
        b.unit.wait_ready()
        b.run_until("DRD_A", count=3, limit_s=TIMEOUT_S)
        with pytest.raises(TimeOut, match=r"POWER_DOWN: expected 1 within 0.05 s"):
            b.run_until("POWER_DOWN", limit_s=0.05)


@HOST
def test_two_units_on_one_bus_are_two_objects() -> None:
    with Bench.start("multi") as b:
        assert list(b.units) == ["a", "b"]
        assert b.units["a"].node.node_id != b.units["b"].node.node_id
        for unit in b.units.values():
            unit.wait_ready()
            assert len(unit.stream(5)) == 5
        assert [b.truth_state(name)["unit"]["name"] for name in b.units] == ["a", "b"]


# ---- looking, breaking, saving


@HOST
def test_a_trace_holds_what_happened_meanwhile(bench: Bench, tmp_path: Path) -> None:
    bench.unit.wait_ready()
    with bench.trace(tmp_path / "run.vcd") as path:
        bench.run_for(0.01)
    text = path.read_text()
    assert "$var wire 1" in text
    assert "Int" in text
    before = len(text)
    bench.run_for(0.01)
    assert len(path.read_text()) == before
    with pytest.raises(ControlError):
        bench.probe.stop()


@HOST
def test_the_truth_of_an_instant_is_told_to_graders(bench: Bench) -> None:
    bench.head.turn(90.0)
    state = bench.truth_state()["unit"]
    assert state["f_mps2"] == pytest.approx(bench.truth_state("a")["unit"]["f_mps2"])
    assert np.linalg.norm(state["f_mps2"]) == pytest.approx(bench.truth()["site"]["g_mps2"], rel=1e-9)


@HOST
def test_a_fault_is_added_seen_and_cleared(bench: Bench) -> None:
    bench.unit.wait_ready()
    assert {"kind", "what", "points", "args"} <= set(bench.faults.kinds()[0])
    assert "a.sensor.x" in bench.faults.points("sensor.bias")
    assert "a.sensor.x" in bench.faults.points()
    clean = bench.unit.stream(20).axis("x")
    with bench.fault("sensor.bias", "a.sensor.x", bias_v=0.1) as fault:
        bench.wait(0.1)
        assert fault.state()["kind"] == "sensor.bias"
        assert bench.unit.stream(20).axis("x").mean() - clean.mean() == pytest.approx(0.1, abs=1e-3)
    bench.wait(0.1)
    assert bench.unit.stream(20).axis("x").mean() == pytest.approx(clean.mean(), abs=1e-6)
    with pytest.raises(ControlError, match="DRD"):
        bench.fault("sensor.bias", "a.line.DRD_A", bias_v=0.1)


@HOST
def test_a_snapshot_and_a_fork_go_on_as_the_bench_itself(bench: Bench, tmp_path: Path) -> None:
    bench.unit.wait_ready()
    bench.head.turn(37.0)
    bench.snapshot(tmp_path / "now.psa")
    with bench.fork() as twin, Bench.restore(tmp_path / "now.psa") as again:
        want = bench.unit.stream(50)
        for other in (twin, again):
            assert other.time_s < bench.time_s
            assert other.head.angle_deg == bench.head.angle_deg
            got = other.unit.stream(50)
            assert np.array_equal(got.u_v, want.u_v)
            assert np.array_equal(got.t_sample_s, want.t_sample_s)
        twin.head.turn(0.0)
        assert bench.head.angle_deg == 37.0
        assert twin.emulator is not None
        process = Path(f"/proc/{twin.emulator.pid}")
        assert process.exists()
    until(lambda: not process.exists(), "the end of the fork")


@HOST
def test_a_damaged_snapshot_is_refused_in_one_line(bench: Bench, tmp_path: Path) -> None:
    path = bench.snapshot(tmp_path / "now.psa")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(BadInput, match=r"now\.psa") as refused:
        Bench.restore(path)
    assert str(refused.value).count("\n") == 0


@HOST
def test_units_on_several_buses_are_all_there_and_in_step() -> None:
    """Every unit of the fleet answers on its own bus, and a run returns when the frames of all buses are here."""
    with Bench.start("fleet64") as b:
        assert (len(b.units), len(b.hosts)) == (64, 8)
        first, last = b.board(Psa2, "a1"), b.board(Psa2, "h1")  # the same node, each on its bus
        assert first.node.node_id == last.node.node_id
        first.wait_ready()
        before = [h.received for h in b.hosts.values()]
        b.run_for(0.1)
        came = [h.received - n for h, n in zip(b.hosts.values(), before, strict=True)]
        delivered = b.control.call("frames").result["clients"]
        assert [h.received for h in b.hosts.values()] == [c["delivered"] for c in delivered]
        assert min(came[1:]) > 100
        u_v = [u.stream(5).axis("x").mean() for u in (first, last)]
        assert u_v[0] != u_v[1]
