"""Cycles on the parallel buses of the boards by command: bus.read, bus.write of the control socket."""

from __future__ import annotations

import itertools
import json
import socket
import time
from pathlib import Path

import pytest
from psabench.emulator import Emulator
from psabench.errors import ControlError
from psabench.link.busport import BusPort, Who
from psabench.link.control import Control, Reply
from rig import HERE, TIMEOUT_S, talker

pytestmark = pytest.mark.host

SCENARIO = HERE / "faults_boards.yaml"
PMKA_MODE, PMKA_BEAT, PMKA_SEQ = 9, 11, 6  # docs/reference/protocol_pmka.md
PIK_LATCH = 11  # docs/reference/protocol_pik.md
PSD1_TEMP, PSD1_SERVICE = 10, 11  # docs/reference/protocol_psd1.md


def control_of(emulator: Emulator) -> Control:
    return Control(emulator.control_path or Path())


def test_in_step_pace_time_moves_by_the_strobe() -> None:
    with Emulator(SCENARIO, pace="step") as emulator, control_of(emulator) as control:
        now_ns = control.call("run", for_s=0.5).t_ns
        for unit, strobe_ns in (("d", 800), ("m", 800), ("p", 1000)):  # of the profile, then of the command
            for args, want_ns in (({}, strobe_ns), ({"strobe_ns": 2500}, 2500)):
                reply = control.call("bus.read", unit=unit, address=PMKA_SEQ, **args)
                assert reply.t_ns - now_ns == want_ns, unit
                assert reply.result["ended_s"] == pytest.approx(reply.t_ns * 1e-9, abs=1e-12)
                now_ns = reply.t_ns
        assert control.call("bus.read", unit="m", address=PMKA_SEQ).result["name"] == "SEQ"
        control.call("bus.write", unit="m", address=PMKA_BEAT, data=321)
        assert control.call("bus.read", unit="m", address=PMKA_BEAT).result == pytest.approx(
            {"name": "BEAT", "data": 321, "ended_s": control.call("time").t_ns * 1e-9}
        )


@pytest.mark.parametrize("supply", [True, False])
def test_psd_1_tells_the_supply(supply: bool, tmp_path: Path) -> None:
    """Code 2500 +- 4 sd of the specimen at 12 V, 5/6 of it at 10 V; without a supply always the same."""
    path = tmp_path / "supply.yaml"
    path.write_text(("supply: {volt_v: 12}\n" if supply else "") + "units: [{name: d, board: psd1}]\n")
    with Emulator(path, pace="step") as emulator, control_of(emulator) as control:
        control.call("run", for_s=0.1)
        nominal = control.call("bus.read", unit="d", address=PSD1_SERVICE).result["data"]
        assert abs(nominal - 2500) <= 40
        if supply:
            control.call("supply.set", volt_v=10.0)
        control.call("run", for_s=0.01)
        now = control.call("bus.read", unit="d", address=PSD1_SERVICE).result["data"]
        assert now == pytest.approx(nominal * 10 / 12, abs=1) if supply else now == nominal


def test_each_refusal_has_its_code_and_is_counted() -> None:
    with Emulator(SCENARIO, pace="step") as emulator, control_of(emulator) as control:
        control.call("run", for_s=0.5)

        def code(command: str, **args: object) -> str:
            with pytest.raises(ControlError) as e:
                control.call(command, **args)
            assert len(str(e.value)) > 20, "in words"
            return e.value.code

        def refused(unit: str) -> int:
            board = control.call("counters", unit=unit).result["board"]
            return int(board.get("refused", board.get("cycles_refused")))

        was = {unit: refused(unit) for unit in "dmp"}
        assert code("bus.read", unit="d", address=0) == "taken"  # by the built-in host
        assert code("bus.write", unit="d", address=0, data=1) == "read_only"
        assert code("bus.write", unit="d", address=PSD1_TEMP, data=9) == "value"
        assert code("bus.read", unit="d", address=PSD1_TEMP, strobe_ns=50) == "too_short"
        assert code("bus.read", unit="m", address=15) == "address"
        assert code("bus.write", unit="m", address=PMKA_SEQ, data=1) == "read_only"
        assert code("bus.read", unit="m", address=10) == "write_only"
        assert code("bus.read", unit="m", address=PMKA_SEQ, strobe_ns=50) == "too_short"
        assert code("bus.read", unit="p", address=14) == "address"
        assert code("bus.read", unit="p", address=PIK_LATCH) == "write_only"
        assert code("bus.write", unit="p", address=0, data=1) == "read_only"
        assert code("bus.read", unit="p", address=0, strobe_ns=50) == "too_short"
        assert {unit: refused(unit) - was[unit] for unit in "dmp"} == dict.fromkeys("dmp", 4)
        assert code("bus.read", unit="p", address=16) == "range"
        control.call("supply.output", on=False)
        control.call("run", for_s=0.1)
        for unit in "dmp":
            assert code("bus.read", unit=unit, address=3) == "off"


def test_a_board_without_a_bus_says_so() -> None:
    with Emulator("quiet", pace="step") as emulator, control_of(emulator) as control:
        with pytest.raises(ControlError, match="unit: expected a board with a parallel bus, got a, a PSA-2") as e:
            control.call("bus.read", unit="a", address=0)
        assert e.value.code == "range"


def begin_and_go(emulator: Emulator, line: bytes) -> None:
    """Sends a command and goes away without its answer, once it is carried out: the one behind it has been answered."""
    with socket.socket(socket.AF_UNIX) as rude:
        rude.settimeout(TIMEOUT_S)
        rude.connect(str(emulator.control_path))
        rude.sendall(line + b'\n{"id":2,"cmd":"time"}\n')
        with rude.makefile("rb") as answers:
            while json.loads(answers.readline()).get("id") != 2:
                pass


def until_free(control: Control, command: str, **args: object) -> tuple[Reply, int]:
    """The answer, and how often the bus was another's before."""
    deadline_s = time.monotonic() + TIMEOUT_S
    for refused in itertools.count():
        try:
            return control.call(command, **args), refused
        except ControlError as e:
            if e.code != "busy" or time.monotonic() > deadline_s:
                raise
    raise AssertionError


def test_in_real_time_the_answer_comes_by_itself() -> None:
    """Two programs at once, at two boards; at one of them a third has begun a cycle, and went away without waiting: it
    is carried out, and the bus is free when it is over. How many are refused until then is up to the machine."""
    with Emulator(SCENARIO, pace="wall") as emulator, control_of(emulator) as one, control_of(emulator) as two:
        begin_and_go(emulator, b'{"id":1,"cmd":"bus.read","args":{"unit":"p","address":10,"strobe_ns":500000000}}')
        _, refused = until_free(one, "bus.write", unit="p", address=12, data=100)
        for n in range(20):
            one.call("bus.write", unit="p", address=12, data=100 + n)
            two.call("bus.write", unit="m", address=PMKA_BEAT, data=300 + n)
            assert one.call("bus.read", unit="p", address=12).result["data"] == 100 + n
            assert two.call("bus.read", unit="m", address=PMKA_BEAT).result["data"] == 300 + n
        board = one.call("counters", unit="p").result["board"]
        assert (board["cycles"], board["cycles_refused"]) == (1 + 1 + 2 * 20, refused)


def test_who_comes_while_another_has_the_bus_is_refused(tmp_path: Path) -> None:
    """A cycle from the bus port, in step pace: it is under way for as long as no one lets time pass."""
    link = tmp_path / "port"
    with (
        Emulator(SCENARIO, pace="step", extra=("--bus-port", f"p:{link}")) as emulator,
        control_of(emulator) as control,
    ):
        with BusPort(link) as port:
            port.ask("?\nR A 500000000")
            assert isinstance(port.answer(), Who)
            for _ in range(3):
                with pytest.raises(ControlError, match="another cycle is under way") as e:
                    control.call("bus.read", unit="p", address=12)
                assert e.value.code == "busy"
            begun_ns = control.call("time").t_ns
            control.call("run", for_s=0.5)
            assert port.answer().t_s == pytest.approx(begun_ns * 1e-9 + 0.5, abs=1e-9)
            assert control.call("bus.read", unit="p", address=12).result["name"] == "PERIOD"
        board = control.call("counters", unit="p").result["board"]
        assert (board["cycles"], board["cycles_refused"]) == (2, 3)


def test_cycles_are_in_a_snapshot(tmp_path: Path) -> None:
    """Those that were carried out and those that were refused: the restored bench is the same to its digest."""
    path = tmp_path / "cycles.snapshot"
    with Emulator(SCENARIO, pace="step") as emulator, control_of(emulator) as control, talker(emulator):
        control.call("run", for_s=0.3)
        control.call("bus.write", unit="m", address=PMKA_MODE, data=1)
        control.call("bus.write", unit="p", address=PIK_LATCH, data=0)
        with pytest.raises(ControlError):
            control.call("bus.read", unit="m", address=15)
        control.call("run", for_s=0.2)
        seq = control.call("bus.read", unit="p", address=9).result["data"]
        control.call("snapshot", path=str(path))
    with Emulator(pace="step", extra=("--restore", path)) as emulator, control_of(emulator) as control:
        assert control.call("bus.read", unit="m", address=PMKA_MODE).result["data"] == 1
        assert control.call("bus.read", unit="p", address=9).result["data"] == seq
        assert control.call("counters", unit="m").result["board"]["cycles_refused"] == 1


def test_timeout_has_an_end() -> None:
    """A strobe of a second: the answer is there when it is over, well before anybody gives up."""
    with Emulator(SCENARIO, pace="step") as emulator, control_of(emulator) as control:
        control.call("run", for_s=0.3)
        before_ns = control.call("time").t_ns
        after_ns = control.call("bus.read", unit="p", address=10, strobe_ns=1_000_000_000).t_ns
        assert after_ns - before_ns == 1_000_000_000
