"""PSD-1, PMKA and PIK as a host meets them: on CAN, and on the parallel bus through a bus port."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from psabench.conform.host.cases_can import NODE, STREAM, Case
from psabench.conform.host.check import limits
from psabench.conform.host.stimulus import Stage

PIKS = ("pik", "pik5", "pik6")
BUS = ("bus",)
INPUT_V = (1.2, -0.6, 0.024)  # article: 1.2 V/g
NEAR_RANGE_V = float(limits("HOST-PIK-02").limit("input_v"))
BEYOND_V = float(limits("HOST-PIK-03").limit("input_v"))
ROM_S = 30.0  # simulated, for a host to read the correction ROM word by word
COLD_DEGC = float(limits("HOST-PMKA-02").limit("cold_degc"))
WARM_DEGC = float(limits("HOST-PMKA-01").limit("warm_degc"))


def scenario(volts: tuple[float, float, float] = INPUT_V, degc: float = 25.0) -> str:
    """One unit with steady inputs; BOARD and PROFILE are filled in."""
    axes = "\n".join(
        f"      {axis}: {{sensor: mems, u0_v: {v}, kx_v_per_g: 0.0}}" for axis, v in zip("xyz", volts, strict=True)
    )
    return f"""\
seed: 1
bus: {{bitrate_hz: 1000000}}
site: {{g_mps2: 9.8}}
units:
  - name: a
    board: BOARD
    profile: PROFILE
    node: {NODE}
    serial: 1
    temp_degc: [{degc}, {degc}, {degc}, {degc}]
    axes:
{axes}
"""


def _lost_cycles(s: Stage) -> None:
    """1, 2 and 100 of PSD1_CYCLE do not arrive."""
    for frames in (1, 2, 100):
        s.run(0.1)
        s.fault("link.drop", "a.can", frames=frames, can_id=0x180 + NODE)
    s.run(0.3)


def _strobed(s: Stage) -> None:
    """The stage strobes the words itself: in time, late, after the next conversion, and for a while not at all."""
    late_s = 1.5e-6 * float(limits("HOST-PSD1-02").limit("late_us"))
    s.run(0.2)
    _cycle(s, write=15, data=3)  # INT0 and FL1
    for _ in range(40):  # until what is read goes out: the host has started the stream
        before = s.sent()
        _strobe(s, 20)
        s.run(0.05)
        if s.sent() - before >= 20:
            break
    for wait_s in (0.0, late_s, 0.0, 0.002, 0.0, late_s, 0.0) * 3:
        for axis in range(3):
            _await_word(s, axis)
            if axis == 1:
                s.run(wait_s, speed=0.0)
            _cycle(s, read=axis)
    s.run(0.02)
    _strobe(s, 20)


def _strobe(s: Stage, cycles: int) -> None:
    """Words read as soon as they wait."""
    for _ in range(cycles):
        for axis in range(3):
            _await_word(s, axis)
            _cycle(s, read=axis)


def _cycle(s: Stage, *, read: int | None = None, write: int = 0, data: int = 0) -> int:
    if read is not None:
        return int(s.control.call("bus.read", unit="a", address=read).result["data"])
    s.control.call("bus.write", unit="a", address=write, data=data)
    return data


def _await_word(s: Stage, axis: int) -> None:
    for _ in range(5000):
        status = _cycle(s, read=3)
        if status & 1 and status >> 1 & 3 == axis:
            return
        s.run(0.000005, speed=0.0)


def _minute(s: Stage) -> None:
    """And as long before and after as the rotation takes to bring every axis back to its own integrator."""
    s.run(float(limits("HOST-PMKA-01").limit("duration_s")) + 6.0, speed=0.0)


def _pmka_lost(s: Stage) -> None:
    for readings in (1, 3):
        s.run(0.5)
        s.run_between()
        s.fault("link.drop", "a.can", frames=2 * readings, **STREAM)
    s.run(0.5)
    s.fault("sensor.stuck", "a.sensor.x", out_v=float(limits("HOST-PMKA-03").limit("input_v")))
    s.run(0.5)
    s.clear()
    s.run(0.5)


def _pik_lost(s: Stage) -> None:
    """Increments are lost with their frames: one, two in a row, thirty."""
    for frames in (1, 2, 30):
        s.run(0.3)
        s.fault("link.drop", "a.can", frames=frames, can_id=0x180 + NODE)
    s.run(1.0)


def _pik_over(s: Stage) -> None:
    for axis in "xyz":
        for sign in (1, -1):
            s.fault("sensor.stuck", f"a.sensor.{axis}", out_v=sign * BEYOND_V)
            s.run(0.6)
            s.clear()
            s.run(0.6)


def _for(seconds: float) -> Callable[[Stage], None]:
    return lambda s: s.run(seconds)


UNIT_CASES: Mapping[str, Case] = {
    c.name: c
    for c in (
        Case(
            name="psd1_good",
            title="a good board, over the wraps of CNT",
            play=_for(1.0),
            boards=("psd1",),
            scenario=scenario(),
        ),
        Case(
            name="psd1_lost",
            title="1, 2 and 100 cycles are lost",
            play=_lost_cycles,
            boards=("psd1",),
            scenario=scenario(),
        ),
        Case(
            name="psd1_flags",
            title="words read late, after the next conversion, and not at all",
            play=_strobed,
            boards=("psd1",),
            profile="psd1_host",
            scenario=scenario(),
            busy=0,
        ),
        Case(
            name="pmka_warm",
            title="a minute of rotation at 45 °C",
            play=_minute,
            boards=("pmka",),
            scenario=scenario(degc=WARM_DEGC),
            busy=15,
            ready_s=ROM_S,
        ),
        Case(
            name="pmka_cold",
            title="a minute of rotation at -10 °C, inputs the other way round",
            play=_minute,
            boards=("pmka",),
            scenario=scenario((-INPUT_V[0], -INPUT_V[1], -INPUT_V[2]), COLD_DEGC),
            busy=15,
            ready_s=ROM_S,
        ),
        Case(
            name="pmka_lost",
            title="readings are lost, an input is beyond the range",
            play=_pmka_lost,
            boards=("pmka",),
            scenario=scenario(),
            busy=15,
            ready_s=ROM_S,
        ),
        Case(
            name="pik_lost",
            title="increments are lost with their frames",
            play=_pik_lost,
            boards=PIKS,
            scenario=scenario(),
            busy=12,
        ),
        Case(
            name="pik_over",
            title="each channel beyond its range, both ways",
            play=_pik_over,
            boards=PIKS,
            scenario=scenario(),
            busy=12,
        ),
        Case(
            name="psd1_bus",
            title="words that wait for the strobe of the host",
            play=lambda s: s.serve(0.05, cycle_s=4e-6),
            boards=("psd1",),
            scenario=scenario(),
            links=BUS,
        ),
        Case(
            name="pik_bus",
            title="a minute at 9 V by registers of 16 bits",
            play=lambda s: s.serve(float(limits("HOST-PIK-02").limit("duration_s")), cycle_s=0.0005, leap_s=0.1),
            boards=PIKS,
            scenario=scenario((NEAR_RANGE_V, -NEAR_RANGE_V, NEAR_RANGE_V / 2)),
            links=BUS,
        ),
    )
}
