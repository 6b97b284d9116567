"""What the host has for every board: the shell's words, recordings, which class is at a node."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import can
import pytest
from board_units import NODES, SCENARIO, SETUP_S
from psabench import Bench
from psabench.boards.decode import decode_can
from psabench.boards.pik.device import Pik
from psabench.boards.psd1.device import Psd1
from psabench.errors import BadInput, BenchError, LinkError
from psabench.link.can_host import CanHost
from psabench.link.control import Control
from psabench.shell.session import Session
from rig import HOST, MakeRig


@HOST
def test_the_shell_s_words_for_the_device_go_for_every_board() -> None:
    with Bench.start(SCENARIO) as bench:
        bench.wait(SETUP_S)
        session = Session(bench)

        def say(line: str) -> Any:
            outcome = session.do(line)
            assert outcome is not None
            return outcome.result

        for name, (kind, _) in NODES.items():
            assert say(f"dut.use {name}")["unit"] == name
            assert isinstance(session.dut, kind)
            say("dut.stop")
            assert say("dut.counters")["Malformed requests"] == 0
            assert say("dut.object 1008h")["value"] == kind.title
            if name == "psd1_host":
                continue
            assert len(say("dut.registers")["registers"]) >= 10
            taken = say("dut.stream 10")
            assert (taken["frames"], taken["lost"]) == (10, 0)
        rows = {r["register"]: r for r in say("dut.registers bus")["registers"]}
        assert rows["X"]["value"] == "-"
        assert "too early" in rows["X"]["fields"]
        assert rows["STATUS"]["fields"].startswith("FL2 0 no word waits, ")
        assert "READY 1 set up" in rows["STATUS"]["fields"]
        assert rows["COMMAND"]["fields"] == "RUNS 0 no, FAILED 0 no, LATEST 00h none"
        assert session.vocabulary.commands["dut.form"].what.startswith("Not of a PSD-1")
        assert say("dut.write bus UC_LOW A55Ah") == {}
        assert say("dut.register bus UC_LOW")["value"] == "A55Ah"
        with pytest.raises(BenchError, match="too early") as early:
            session.do("dut.register bus X")
        assert "dut.ready" not in str(early.value), "that is for a board that is being set up"
        say("dut.use psd1")
        with pytest.raises(BenchError, match=r"address 00h \(X\).*too early.*profile psd1_host") as not_now:
            session.do("dut.object 2002h 1")
        assert "dut.ready" not in str(not_now.value)
        for text, word in (("220014h", 0x220014), ("0x220013", 0x220013), (str(0x220014), 0x220014)):
            assert say(f"dut.set 2042h 0 {text}") == {}
            assert say("dut.object 2042h")["value"] == word
        with pytest.raises(BenchError, match="abort 06090030h"):
            session.do("dut.set 2042h 0 228013h")  # 24-bit words: the board's to refuse
        for text in ("fish", "1FFFFFFFFh"):
            with pytest.raises(BenchError, match=f"value: '{text}'"):
                session.do(f"dut.set 2042h 0 {text}")
        assert say("dut.set 2040h 0 56h") == {}
        assert say("dut.object 2040h")["value"] == "56h", "characters stay characters"
        say("dut.use psa2")
        assert session.vocabulary.commands["dut.form"].args[0].offers[0] == "pair"
        say("dut.use pmka")
        stream = say("dut.stream 5")
        assert [r["signal"] for r in stream["signals"]][:4] == ["X", "Y", "Z", "K"]
        for line, why in (
            ("dut.opcode accel 4", "expected a PSA-2 for this command, got pmka"),
            ("dut.form", "expected a PSA-2 for this command, got pmka"),
            ("dut.registers x", "bank of a PMKA: expected bus, got 'x'"),
            ("dut.write bus MODE 10000h", "expected a word"),
            ("dut.register bus COMMAND", "write-only"),
        ):
            with pytest.raises(BenchError, match=why):
                session.do(line)


@HOST
def test_the_shell_knows_the_events_of_every_board_and_its_cycles_move_time() -> None:
    with Bench.start(SCENARIO) as bench:
        bench.wait(SETUP_S)
        session = Session(bench)
        event = session.vocabulary.commands["until"].arg("event")
        assert event is not None
        assert {"DRD_A", "A0", "FL2", "TAU", "LATCH"} <= set(event.choices)
        assert session.do("until A0 unit=psd1") is not None
        before_s = bench.time_s
        outcome = session.do("bus.read psd1 3")
        assert outcome is not None
        assert outcome.result["name"] == "STATUS"
        assert bench.time_s == pytest.approx(outcome.result["ended_s"], abs=1e-9)
        assert bench.time_s > before_s


@HOST
def test_recordings_of_other_boards_are_counted_and_decoded(tmp_path: Path) -> None:
    with Bench.start(SCENARIO, extra=("--start",)) as bench:
        log = tmp_path / "bus.log"
        messages: list[can.Message] = []
        bench.host.listeners.append(messages.append)
        bench.wait(SETUP_S + 0.5)
    with can.Logger(str(log)) as writer:
        for m in messages:
            writer(m)
    for name, least, unit in (("psd1", 400, "LSB"), ("pmka", 80, "V"), ("pik", 40, "pulses")):
        kind, node = NODES[name]
        out = io.StringIO()
        reader = decode_can(log, node, out, kind.board)
        assert (reader.counters.lost, reader.counters.torn) == (0, 0)
        rows = list(csv.DictReader(io.StringIO(out.getvalue())))
        assert len(rows) == reader.counters.frames >= least
        assert set(rows[0]) > {"t_rx_s", "t_sample_s", kind.layout.counter, *(f"{axis}_{unit}" for axis in "XYZ")}
        assert all(("." in row[f"X_{unit}"]) == (unit == "V") for row in rows), "codes and counts are whole numbers"
    with pytest.raises(BadInput, match=r"expected frames of node 9, got none; nodes with frames: .*6"):
        decode_can(log, 9, io.StringIO(), "psd1")


@HOST
def test_a_bench_finds_units_by_their_boards() -> None:
    with Bench.start(SCENARIO) as bench:
        assert {n: type(u) for n, u in bench.units.items()} == {n: kind for n, (kind, _) in NODES.items()}
        assert bench.unit is bench.units["psa2"]
        assert bench.board(Psd1) is bench.units["psd1"]
        assert bench.board(Psd1, "psd1_host").node.node_id == 16
        with pytest.raises(BenchError, match="expected a PIK, got psd1"):
            bench.board(Pik, "psd1")
        with pytest.raises(BenchError, match=r"unit: expected psa2, psd1, .*got nosuch"):
            bench.board(Pik, "nosuch")
        told = bench.control.call("units").result["units"]
        assert {u["name"]: u["board"] for u in told} == {n: kind.board for n, (kind, _) in NODES.items()}
        path = bench.control.path
    with pytest.raises(LinkError):
        Control(path)


@HOST
def test_a_real_bench_asks_the_node_what_it_is(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand", SCENARIO, pace="wall")
    assert isinstance(rig.host, CanHost)
    for kind, node in NODES.values():
        with Bench.connect(rig.spec, node=node) as bench:
            assert type(bench.units["a"]) is kind
            assert bench.units["a"].counters()["Malformed requests"] == 0
