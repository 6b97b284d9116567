"""How a host that knows the protocol sees each kind of fault of a PSA-2, and at which points it is possible.

The host has CAN and, for the lines of a board, a recording; what it looks for is in docs/reference/protocol.md and
docs/boards/psa2.md.
"""

from __future__ import annotations

import numpy as np
from fault_case import FaultCase, Looks, near
from fault_host import ACCEL_PORT, PERIOD_S, SETTLE_S, SETUP_S, TEMP_PORT, Seen
from fault_lines import breaches
from psabench.link.vcd import read_vcd


class Case(FaultCase):
    """A kind at a point of a PSA-2."""

    @property
    def temperature(self) -> bool:
        return self.point.endswith(".tadc")

    def watch(self, dwell_s: float) -> Seen:
        return self.host.watch(self.unit, dwell_s)

    def settled(self, dwell_s: float = 0.03) -> Seen:
        """What is seen when the filters have settled."""
        self.host.bus.advance(SETTLE_S)
        return self.watch(dwell_s)

    def mean_v(self) -> float:
        return self.settled().mean_v(self.axis)

    def turned_v(self) -> list[float]:
        """Settled volts of the axis with the head at 0 and at 90 degrees."""
        volts = []
        for angle_deg in (0.0, 90.0):
            self.host.turn(angle_deg)
            volts.append(self.mean_v())
        return volts


DETECT = Looks[Case]()


# ---- sensors and analog chain: what the codes of the axis say


@DETECT.look("sensor.stuck")
def sensor_stuck(c: Case) -> None:
    c.host.turn(0.0)
    c.host.bus.advance(SETTLE_S)
    healthy = c.turned_v()
    assert abs(healthy[1] - healthy[0]) > 0.1, "the head turns, the axis feels it"
    c.add()
    stuck = c.turned_v()
    near(stuck[0], healthy[1], 1e-4)
    near(stuck[1], healthy[1], 1e-4)


@DETECT.look("sensor.bias")
def sensor_bias(c: Case) -> None:
    before_v = c.mean_v()
    c.add(bias_v=0.1)
    near(c.mean_v() - before_v, 0.1, 1e-4)


@DETECT.look("sensor.drift")
def sensor_drift(c: Case) -> None:
    c.add(drift_v_per_s=0.5)
    volts = c.settled(0.05).volts(c.axis)
    near(float(np.diff(volts).mean()) / PERIOD_S, 0.5, 0.01)


@DETECT.look("sensor.scale")
def sensor_scale(c: Case) -> None:
    healthy = c.turned_v()
    c.add(scale_ppm=10000)
    wrong = c.turned_v()
    near((wrong[1] - wrong[0]) / (healthy[1] - healthy[0]), 1.01, 1e-4)


@DETECT.look("sensor.noise")
def sensor_noise(c: Case) -> None:
    assert c.settled(0.1).volts(c.axis).std() < 1e-4
    c.add(rms_v=0.01)
    assert 0.005 < c.settled(0.2).volts(c.axis).std() < 0.02


@DETECT.look("sensor.saturation")
def sensor_saturation(c: Case) -> None:
    limit_v = c.mean_v() - 0.25
    c.add(high_v=limit_v)
    near(c.mean_v(), limit_v, 1e-3)


@DETECT.look("sensor.open")
def sensor_open(c: Case) -> None:
    """Of all channels that one alone; the inputs do not feel it."""
    channel = ["x", "y", "z", "board"].index(c.point.split(".")[-1])
    healthy = c.settled(0.1)
    c.add()
    c.watch(0.1)  # each channel once
    seen = c.watch(0.1)
    for k, codes in seen.temperatures().items():
        near(float(np.mean(codes)), 0.0 if k == channel else float(np.mean(healthy.temperatures()[k])), 30)
    assert min(abs(x) for x in healthy.temperatures()[channel]) > 1000
    near(seen.mean_v(0), healthy.mean_v(0), 1e-4)


@DETECT.look("analog.load_open")
def load_open(c: Case) -> None:
    c.add()
    seen = c.settled()
    near(seen.mean_v(c.axis), 10.0, 1e-5)
    assert seen.clipped()


@DETECT.look("analog.load_short")
def load_short(c: Case) -> None:
    assert abs(c.mean_v()) > 0.1
    c.add()
    near(c.mean_v(), 0.0, 1e-4)


@DETECT.look("analog.reference")
def reference(c: Case) -> None:
    before_v = c.mean_v()
    c.add(reference_ppm=10000)
    near(c.mean_v() / before_v, 1 / 1.01, 1e-5)


@DETECT.look("analog.ripple")
def ripple(c: Case) -> None:
    """20 Hz over five of its periods."""
    c.add(amplitude_v=0.1, frequency_hz=20)
    volts = c.settled(0.25).volts(c.axis)[:250]
    phase = 2 * np.pi * 20 * PERIOD_S * np.arange(len(volts))
    near(2 * abs(np.mean(volts * np.exp(-1j * phase))), 0.1, 0.005)


# ---- chips and controller


@DETECT.look("chip.drdy_stuck")
def no_drdy(c: Case) -> None:
    for level in ("high", "low"):
        c.add(level=level)
        seen = c.watch(0.6)
        late = c.watch(0.1)
        if c.temperature:
            assert TEMP_PORT in seen.emcy
            assert not late.temperatures()
        else:
            assert ACCEL_PORT in seen.emcy
            assert not late.xy
        c.clear()
        c.reset()
        assert c.watch(0.1).temperatures()


@DETECT.look("chip.dout_dead")
def dead_dout(c: Case) -> None:
    for level, code in (("high", -1), ("low", 0)):
        c.add(level=level)
        seen = c.settled(0.06)
        if c.temperature:
            assert {t for codes in seen.temperatures().values() for t in codes} == {code}
        else:
            codes = {h[2 + c.axis] for h in seen.xy} if c.axis < 2 else {h[1] for h in seen.zt}
            assert codes == {code}
        c.clear()
        c.host.bus.advance(SETTLE_S)


def answer(seen: Seen, axis: int) -> np.ndarray:
    """The step of an axis, from 0 to 1."""
    volts = seen.volts(axis)
    return np.asarray((volts - volts[0]) / (volts[-1] - volts[0]))


def apart(c: Case) -> float:
    """How far the answers of the three axes to one step of the head are from each other, at most."""
    c.host.turn(0.0)
    c.host.bus.advance(0.2)
    c.watch(0.002)  # before the step
    c.host.turn(90.0)
    c.host.bus.advance(0.15)
    seen = c.host.seen(c.unit)
    x, y, z = (answer(seen, axis) for axis in range(3))
    n = min(len(x), len(y), len(z))
    return float(max(np.abs(x[:n] - y[:n]).max(), np.abs(x[:n] - z[:n]).max()))


def pulse_sync(c: Case, group: int) -> None:
    """SYNC of a group of converters, through the controller: object 2024h makes the SYNC message do it."""
    node = c.host.units[c.unit].node
    node.write(0x2024, 0, group)
    c.host.bus.advance(0.00033)  # in the middle of a period
    c.host.bus.send(0x080, b"")


@DETECT.look("chip.lost_sync")
def lost_sync(c: Case) -> None:
    if c.temperature:
        skipped_sync_t(c)
        return
    assert apart(c) < 1e-3
    c.add()
    pulse_sync(c, 1)
    samples = len(c.watch(0.2).xy)
    if c.axis == 0:  # drives DRD_A: the stream goes on through the SYNC
        near(samples, 200, 2)
    else:
        near(samples, 200 - 63, 2)  # the others start again, this one goes on in its old phase
        assert apart(c) > 0.01


@DETECT.look("controller.skip_sync_t")
def skipped_sync_t(c: Case) -> None:
    """Without a SYNC_T after the change of channel the converter goes on with its 10.00 ms."""
    assert c.watch(1.0).temperature_period_s() > 10.2e-3
    c.add()
    c.watch(0.1)
    near(c.watch(1.0).temperature_period_s(), 10.0e-3, 1e-5)


@DETECT.look("chip.clock")
def clock(c: Case) -> None:
    if c.temperature:
        healthy = sum(map(len, c.watch(0.5).temperatures().values()))
        c.add(clock_ppm=-200000)
        slow = sum(map(len, c.watch(0.5).temperatures().values()))
        assert slow < 0.9 * healthy
    elif c.axis == 0:
        c.add(clock_ppm=-10000)
        near(float(np.diff(c.settled(0.2).stamps_s()).mean()), PERIOD_S * 1.0101, 2e-6)
    else:
        assert apart(c) < 1e-3
        c.add(clock_ppm=-50000)
        c.host.bus.advance(0.2)
        assert apart(c) > 0.01


@DETECT.look("chip.flip")
def flip(c: Case) -> None:
    converter, register, mask = ("t", 2, 0x01) if c.temperature else (c.point[-1], 2, 0x01)
    before = c.host.units[c.unit].register(converter, register)
    c.add(register=register, mask=mask)
    assert c.host.units[c.unit].register(converter, register) == before ^ mask
    c.reset()
    assert c.host.units[c.unit].register(converter, register) == before


@DETECT.look("controller.setup_order")
def setup_order(c: Case) -> None:
    unit = c.host.units[c.unit]
    article = [("x", 1), ("t", 0), ("t", 3)]  # CONFIG0, STATUS, DRATE

    def registers() -> list[int]:
        return [unit.register(converter, register) for converter, register in article]

    healthy = registers()
    c.add()
    c.reset()
    assert registers() != healthy


@DETECT.look("controller.frozen_words")
def frozen_words(c: Case) -> None:
    c.host.turn(0.0)
    c.host.bus.advance(0.2)
    c.add()
    c.watch(0.005)
    c.host.turn(90.0)
    c.host.bus.advance(0.2)
    seen = c.host.seen(c.unit)
    assert all(d == 1 for d in np.diff(seen.seq()) % 65536)
    assert len({h[2:] for h in seen.xy}) == 1
    assert len({h[1] for h in seen.zt}) == 1


# ---- links


@DETECT.look("link.drop")
def drop(c: Case) -> None:
    c.add(probability=0.3)
    seen = c.watch(0.1)
    assert {"numbers", "halves"} & set(seen.complaints())
    assert 50 < len(seen.xy) < 90
    c.clear()
    assert c.host.units[c.unit].counters()["Dropped"] == 0, "the board knows of no loss"


@DETECT.look("link.duplicate")
def duplicate(c: Case) -> None:
    c.add(probability=0.3)
    assert c.watch(0.1).repeated > 20


@DETECT.look("link.reorder")
def reorder(c: Case) -> None:
    c.add(probability=0.3, can_id=0x180 + c.host.node[c.unit])
    seen = c.watch(0.1)
    assert "numbers" in seen.complaints()
    assert set(seen.seq()) == set(range(min(seen.seq()), max(seen.seq()) + 1)), "nothing is lost"


@DETECT.look("link.delay")
def delay(c: Case) -> None:
    before_s = np.median(c.watch(0.05).latency_s())
    c.add(hold_s=0.005)
    c.watch(0.02)
    near(float(np.median(c.watch(0.05).latency_s()) - before_s), 0.005, 1e-3)


@DETECT.look("link.corrupt")
def corrupt(c: Case) -> None:
    c.add(probability=0.5)
    seen = c.watch(0.1)
    assert seen.complaints()
    assert not seen.errors


@DETECT.look("link.error_frame")
def error_frame(c: Case) -> None:
    c.add(probability=0.2)
    seen = c.watch(0.05)
    assert len(seen.errors) > 5
    assert len(seen.xy) > 40, "what was destroyed is sent again"


@DETECT.look("link.bus_off")
def bus_off(c: Case) -> None:
    begun_s = c.host.bus.clock.now_s()
    c.add()
    seen = c.watch(0.05)
    assert seen.xy[0][0] - begun_s > 128 * 11e-6, "128 times 11 recessive bits at 1 Mbit/s, then a frame"
    assert seen.complaints() == [], "its frames have waited"


@DETECT.look("link.stall")
def stall(c: Case) -> None:
    c.add()
    assert c.watch(0.05).halves == ""
    c.clear()
    assert len(c.watch(0.01).xy) > 55, "what was kept comes now"


# ---- supply


@DETECT.look("supply.brownout")
def brownout(c: Case) -> None:
    """In the middle of a frame: Int has been low for 30 of its 74 us."""
    c.add(drop_v=6, for_s=0.02, after="INT_FALL", delay_s=30e-6, unit=c.unit)
    seen = c.watch(0.03)
    for unit in c.host.node:
        assert c.host.seen(unit).boots == 1
    assert len(seen.xy) < 5
    c.host.start()
    again = c.watch(SETUP_S)
    assert again.seq()[0] < 5, "numbers begin again"


# ---- lines: what a recording breaks of the rules


def recorded(c: Case, *, late: bool = False, **args: object) -> dict[str, set[str]]:
    """Res, the set-up and 60 frames; the fault comes before, or late: after the set-up."""
    path = c.host.emulator.directory / "lines.vcd"
    if not late:
        c.add(**args)
    c.host.call("vcd.start", path=str(path), unit=c.unit)
    c.host.bus.advance(0.002)
    c.host.reset(c.unit)
    c.host.bus.advance(0.24)
    if late:
        c.add(**args)
    c.host.bus.advance(0.01)
    c.host.call("vcd.stop")
    return breaches(read_vcd(path))


def line_of(c: Case) -> str:
    return c.point.rpartition(".")[2]


@DETECT.look("line.stuck")
def line_stuck(c: Case) -> None:
    for level in ("low", "high"):
        assert "still" in recorded(c, level=level)[line_of(c)]
        c.clear()


@DETECT.look("line.swapped")
def line_swapped(c: Case) -> None:
    assert recorded(c)[line_of(c)] & {"restless", "misread"}


@DETECT.look("line.open")
def line_open(c: Case) -> None:
    line = line_of(c)
    assert "still" in recorded(c)[line]
    assert c.host.call("lines", unit=c.point[0])["lines"][line] == 1  # fail-safe


@DETECT.look("line.glitch")
def line_glitch(c: Case) -> None:
    assert "narrow" in recorded(c, late=True, width_ns=100)[line_of(c)]


@DETECT.look("line.noise")
def line_noise(c: Case) -> None:
    assert "narrow" in recorded(c, rate_hz=2000, width_ns=100)[line_of(c)]


@DETECT.look("line.missing_pulse")
def line_missing_pulse(c: Case) -> None:
    assert "miscounted" in recorded(c, pulse=40)["CLK"]


@DETECT.look("line.extra_pulse")
def line_extra_pulse(c: Case) -> None:
    assert "miscounted" in recorded(c, pulse=40, width_ns=100)["CLK"]


# What must be accepted; everything else must be refused.
ACCEPTED = {
    "sensor.open": r"[ab]\.temp\.(x|y|z|board)",
    "sensor": r"[ab]\.sensor\.[xyz]",
    "analog.load_open": r"b\.afe\.[xyz]",
    "analog.load_short": r"b\.afe\.[xyz]",
    "analog": r"[ab]\.afe\.[xyz]",
    "chip.drdy_stuck": r"[ab]\.(adc\.x|tadc)",
    "chip": r"[ab]\.(adc\.[xyz]|tadc)",
    "controller": r"[ab]\.kpsa",
    "line.open": r"[ab]\.line\.(Int|Data|CLK)",
    "line.missing_pulse": r"[ab]\.line\.CLK",
    "line.extra_pulse": r"[ab]\.line\.CLK",
    "line": r"[ab]\.line\..*",
    "link.error_frame": r"[ab]\.can|bus\.can0",
    "link.bus_off": r"[ab]\.can",
    "link.stall": r"client\.\d+",
    "link": r"[ab]\.can|bus\.can0|client\.\d+",
    "supply": r"supply",
    "head": r"head",
    "scpi": r"scpi\.(head|supply)",
}
