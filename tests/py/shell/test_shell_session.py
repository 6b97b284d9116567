"""Sessions with a bench that is a stand-in: what is asked of it, what is kept, how a script ends."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from psabench.errors import BadInput, BenchError, ControlError, DeviceError
from psabench.shell import status
from psabench.shell.connect import Opening, addresses
from psabench.shell.lexer import Wrong
from psabench.shell.script import Voice, run_file, run_lines, run_stream
from psabench.shell.session import Session
from psabench.status import GrowingFile
from shell_bench import fake


def test_a_line_becomes_a_command_of_the_table() -> None:
    bench, it = fake()
    outcome = Session(it).do("head.turn 0.5rad")
    assert outcome is not None
    assert outcome.result["angle_deg"] == pytest.approx(28.6478897565412)
    assert bench.control.calls[-1][0] == "head.turn"


def test_paths_are_told_as_absolute_ones() -> None:
    bench, it = fake()
    Session(it).do("probe.start run.vcd b")
    assert bench.control.calls[-1] == ("vcd.start", {"path": os.path.abspath("run.vcd"), "unit": "b"})


def test_time_passes_in_slices_with_a_look_between() -> None:
    bench, it = fake()
    looks: list[int] = []
    session = Session(it)
    session.tick = lambda: looks.append(bench.t_ns)
    session.do("wait 0.25")
    assert looks == [100_000_000, 200_000_000, 250_000_000]
    session.do("at 0.3")
    assert bench.t_ns == 300_000_000
    outcome = session.do("at 0.1")
    assert outcome is not None
    assert outcome.result == {"late_s": 0.2}


def test_what_the_bench_does_not_have_is_refused_with_the_reason() -> None:
    _, it = fake("real")
    session = Session(it)
    for line, words in [
        ("head.turn 1", "head: not available: it needs the control socket of an emulator"),
        ("dut.ready", "dut: not available: it needs a bus (--can"),
        ("faults.add a b", "faults: not available: it needs the control socket"),
        ("scpi.send table *IDN?", "scpi: not available: no instrument has an address"),
        ("at 1", "at: unknown command"),
    ]:
        with pytest.raises(Wrong) as e:
            session.do(line)
        assert words in str(e.value)


def test_a_session_is_saved_as_a_script_that_does_the_same(tmp_path: Path) -> None:
    _, it = fake("wall")
    session = Session(it, start="start quiet seed=3")
    session.do("head.turn 5")
    session.do("wait 0.5")
    with pytest.raises(Wrong):
        session.do("head.spin")
    session.do("expect angle_deg = 5")
    session.do(f"save {tmp_path / 'x.psa'}")
    assert (tmp_path / "x.psa").read_text().splitlines()[1:] == [
        "start quiet seed=3",
        "at 0.0",
        "head.turn 5",
        "wait 0.5",
        "# head.spin   error: head.spin: unknown command; did you mean head.turn or head.mount?",
        "at 0.5",
        "expect angle_deg = 5",
    ]


def test_where_it_cannot_be_saved_one_line_says_so() -> None:
    with pytest.raises(BadInput, match="/nowhere/x: expected a path that can be written, got no such folder"):
        Session(fake()[1]).do("save /nowhere/x")


def lines(text: str, json_too: bool = False) -> tuple[int, list[str]]:
    said: list[str] = []
    return run_lines(Session(fake()[1]), text.splitlines(), Voice(said.append, json=json_too, echo=True)), said


def test_a_script_whose_expectations_hold_ends_with_0() -> None:
    assert lines("# head\nhead.turn 5\n\nexpect angle_deg = 5") == (
        0,
        ["> head.turn 5", "angle_deg  5", "> expect angle_deg = 5"],
    )


def test_a_script_goes_on_after_an_expectation_that_does_not_hold_and_ends_with_1() -> None:
    status, said = lines("head.turn 5\nexpect angle_deg = 6\nhead.read")
    assert (status, said[3:]) == (1, ["FAILED: angle_deg is 5, expected = 6", "> head.read", "angle_deg  5"])


def test_a_wrong_line_is_found_before_anything_is_done(tmp_path: Path) -> None:
    bench, it = fake()
    before = len(bench.control.calls)
    session = Session(it)
    known = len(bench.control.calls)
    for text in ("head.turn 5\nhead.turn 5V", "head.turn 5\nexpect > 3"):
        with pytest.raises(BadInput) as e:
            run_lines(session, text.splitlines(), Voice(print), tmp_path / "x.psa")
        assert str(e.value).startswith(f"{tmp_path}/x.psa:2:")
        assert e.value.exit_status == 2
    assert len(bench.control.calls) == known > before


def test_what_the_bench_refuses_ends_a_script_with_3_and_its_place(tmp_path: Path) -> None:
    with pytest.raises(BenchError) as e:
        run_lines(Session(fake()[1]), ["bench.counters", "head.turn 5"], Voice(print), tmp_path / "x.psa")
    assert str(e.value) == f"{tmp_path}/x.psa:1: bench.counters: not now"
    assert e.value.exit_status == 3


def test_a_pipe_is_carried_out_as_it_comes_in_json() -> None:
    said: list[str] = []
    assert (
        run_stream(Session(fake()[1]), ["head.turn 5\n", "\n", "expect angle_deg < 5\n"], Voice(said.append, json=True))
        == 1
    )
    assert [json.loads(s) for s in said] == [
        {"line": "head.turn 5", "ok": True, "t_s": 0.0, "result": {"angle_deg": 5.0}},
        {
            "line": "expect angle_deg < 5",
            "ok": False,
            "t_s": 0.0,
            "result": {"failed": "angle_deg is 5, expected < 5"},
        },
    ]


def test_an_error_in_json_has_its_status() -> None:
    said: list[str] = []
    with pytest.raises(BenchError):
        run_stream(Session(fake()[1]), ["bench.counters"], Voice(said.append, json=True))
    assert json.loads(said[0]) == {
        "line": "bench.counters",
        "ok": False,
        "error": {"status": 3, "text": "bench.counters: not now"},
    }


def test_a_script_without_a_bench_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.psa"
    for text, words in [
        ("head.turn 5", "expected a first line `start SCENARIO`"),
        ("", "expected a first line `start SCENARIO`"),
        ("start", "x.psa:1:6: scenario: expected a value ("),
        ("# a\nstart quiet seed=-1", "x.psa:2:18: seed: expected a number in range, got -1"),
    ]:
        path.write_text(text)
        with pytest.raises(BadInput) as e:
            run_file(path, Opening(), Voice(print))
        assert words in str(e.value)
    with pytest.raises(BadInput, match="expected a script, got no such file"):
        run_file(tmp_path / "none", Opening(), Voice(print))


def test_the_first_line_of_a_script_and_the_options_say_which_bench() -> None:
    o = Opening().of_script("start quiet seed=3")
    assert (o.scenario, o.seed, o.pace, o.start) == ("quiet", 3, "step", "start quiet seed=3")
    o = Opening(scenario="mine.yaml", pace="wall", seed=4).of_script("start quiet seed=3 pace=step")
    assert (o.scenario, o.seed, o.pace) == ("mine.yaml", 4, "wall")
    there = Opening(connect=Path("ctl"))
    assert there.of_script("start quiet") == there
    assert there.start == ""
    assert Opening().of_script("head.turn 5") == Opening()


def test_addresses_of_instruments() -> None:
    assert addresses(["table=TCPIP::192.0.2.7::5025::SOCKET"]) == {"table": "TCPIP::192.0.2.7::5025::SOCKET"}
    for wrong in ("table", "tabel=x", "table="):
        with pytest.raises(BadInput, match="expected NAME=VISA-ADDRESS"):
            addresses([wrong])


def test_the_status_bar() -> None:
    bench, it = fake()
    bench.t_ns = 1_234_567_890
    assert (
        status.line(bench.status(), bench.t_ns)
        == "1.235 s step | table 10.0000 deg 1.5000 deg/s | 25.00 degC | frames 7 | late 1 | lost 2"
    )
    now_s = 0.0
    watch = status.Watch(it, lambda: bench.t_ns, clock=lambda: now_s)
    first = watch.text()
    bench.t_ns *= 2
    assert watch.text() == first  # looked at not long ago
    now_s = 1.0
    assert watch.text().startswith("2.469 s")


@pytest.mark.parametrize(
    ("size_bytes", "max_bytes", "error", "text"),
    [
        (1_234_567, 1_000_000_000, "", "vcd 1.2 of 1000 MB"),
        (1_234_567, 0, "", "vcd 1.2 MB"),
        (499_990, 500_000, "its limit of 0.5 MB is reached", "vcd: its limit of 0.5 MB is reached"),
    ],
)
def test_the_status_bar_has_the_size_and_the_limit_of_a_recording(
    size_bytes: int, max_bytes: int, error: str, text: str
) -> None:
    file = GrowingFile(kind="vcd", size_bytes=size_bytes, max_bytes=max_bytes, error=error)
    bench, _ = fake()
    assert status.line(replace(bench.status(), files=(file,)), 0).split(" | ")[-1] == text


def test_the_refusal_of_an_argument_is_a_wrong_line(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, it = fake()
    session = Session(it)

    def refuse(command: str, /, **args: object) -> None:
        raise ControlError(command, "range", "angle_deg: 5 is outside 0 ... 1")

    monkeypatch.setattr(bench.control, "call", refuse)
    with pytest.raises(Wrong, match="outside 0"):
        session.do("head.turn 5")


def test_a_refusal_has_the_names_of_the_shell(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, it = fake()
    session = Session(it)

    def refuse(command: str, /, **args: object) -> None:
        raise ControlError(command, "state", "a recording goes on; vcd.start began it")

    monkeypatch.setattr(bench.control, "call", refuse)
    with pytest.raises(BenchError, match=r"^probe\.start: a recording goes on; probe\.start began it$"):
        session.do("probe.start x.vcd")


def test_a_board_that_is_being_set_up_points_to_dut_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session(fake()[1])

    def refuse(_: Session, __: object) -> None:
        raise DeviceError("node 5: read 2000h:2", 0x08000022, "not in this state")

    monkeypatch.setattr(Session, "_result", refuse)
    with pytest.raises(BenchError, match=r"not in this state; while the board is being set up: dut\.ready waits"):
        session.do("head.read")
    session.bench.units["a"] = SimpleNamespace(refusal=lambda: "refused: too early")  # type: ignore[assignment]
    session.dut_name = "a"
    with pytest.raises(BenchError, match=r"not in this state; in its own words \(object 2031h\): refused: too early$"):
        session.do("head.read")
