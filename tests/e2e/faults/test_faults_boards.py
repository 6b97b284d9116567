"""Every kind of fault at every point of the other boards: refused with the reason, or seen on the wire.

As test_faults.py does for PSA-2, by a host that knows the pages alone. Faults of lines: test_faults_boards_lines.py.
"""

from __future__ import annotations

import numpy as np
import pytest
from fault_boards import ACCEPTED, BOARDS, SCENARIO, SETUP_S, Board, Seen, seen
from fault_case import VALUES, FaultCase, Looks, accepted, must_accept, near
from fault_host import Host, fault_host

pytestmark = pytest.mark.host

SETTLE_S = 0.05
LOOK_S = 0.5


class Case(FaultCase):
    """A kind at a point of one of the other boards."""

    setup_s = SETUP_S

    @property
    def board(self) -> Board:
        return BOARDS[boards(self.host)[self.unit]]

    def watch(self, dwell_s: float = LOOK_S) -> Seen:
        self.host._kept.clear()
        for _ in range(int(dwell_s / LOOK_S)):  # no more than the sockets hold
            self.host.bus.advance(LOOK_S)
        self.host.bus.advance(dwell_s % LOOK_S)
        return seen(self.host, self.unit, self.board)

    def settled(self, dwell_s: float = LOOK_S) -> Seen:
        self.host.bus.advance(SETTLE_S)
        return self.watch(dwell_s)

    def mean_v(self) -> float:
        return self.settled().mean_v(self.axis)

    def turned_v(self) -> list[float]:
        volts = []
        for angle_deg in (0.0, 90.0):
            self.host.turn(angle_deg)
            volts.append(self.mean_v())
        self.host.turn(30.0)
        return volts

    def read(self, address: int) -> int:
        """A cycle on the parallel bus."""
        return int(self.host.call("bus.read", unit=self.unit, address=address)["data"])

    def write(self, address: int, data: int) -> None:
        self.host.call("bus.write", unit=self.unit, address=address, data=data)


def boards(host: Host) -> dict[str, str]:
    return {u["name"]: u["board"] for u in host.call("units")["units"]}


DETECT = Looks[Case]()
TOLERANCE_V = 5e-3  # PIK-6: a pulse in half a second is 1 mV; PMKA: what the period cuts off


# ---- sensors and analog chain


@DETECT.look("sensor.stuck")
def sensor_stuck(c: Case) -> None:
    healthy = c.turned_v()
    assert abs(healthy[1] - healthy[0]) > 0.1, "the head turns, the axis feels it"
    c.host.turn(90.0)
    c.add()
    for v in c.turned_v():
        near(v, healthy[1], TOLERANCE_V)


@DETECT.look("sensor.bias")
def sensor_bias(c: Case) -> None:
    before_v = c.mean_v()
    c.add(bias_v=0.1)
    near(c.mean_v() - before_v, 0.1, TOLERANCE_V)


@DETECT.look("sensor.drift")
def sensor_drift(c: Case) -> None:
    c.add(drift_v_per_s=0.5)
    first = c.settled().mean_v(c.axis)
    near((c.watch().mean_v(c.axis) - first) / LOOK_S, 0.5, 0.02)


@DETECT.look("sensor.scale")
def sensor_scale(c: Case) -> None:
    healthy = c.turned_v()
    c.add(scale_ppm=100000)
    wrong = c.turned_v()
    near((wrong[1] - wrong[0]) / (healthy[1] - healthy[0]), 1.1, 0.02)


@DETECT.look("sensor.noise")
def sensor_noise(c: Case) -> None:
    before_v = c.settled().volts(c.axis).std()
    c.add(rms_v=0.5)
    assert c.settled().volts(c.axis).std() > before_v + 0.1


@DETECT.look("sensor.saturation")
def sensor_saturation(c: Case) -> None:
    limit_v = c.mean_v() - 0.25
    c.add(high_v=limit_v)
    near(c.mean_v(), limit_v, TOLERANCE_V)


@DETECT.look("analog.load_open")
def load_open(c: Case) -> None:
    c.add()
    assert c.settled().mean_v(c.axis) > 0.95 * c.board.full_v


@DETECT.look("analog.load_short")
def load_short(c: Case) -> None:
    assert abs(c.mean_v()) > 0.1
    c.add()
    near(c.mean_v(), 0.0, TOLERANCE_V)


@DETECT.look("analog.reference")
def reference(c: Case) -> None:
    before_v = c.mean_v()
    c.add(reference_ppm=10000)
    near(c.mean_v() / before_v, 1 / 1.01, 3e-3)


@DETECT.look("analog.ripple")
def ripple(c: Case) -> None:
    """20 Hz over ten of its periods."""
    c.add(amplitude_v=0.5, frequency_hz=20)
    volts = c.settled().volts(c.axis)
    phase = 2 * np.pi * np.arange(len(volts)) * 20 * c.board.period_s
    near(2 * abs(np.mean((volts - volts.mean()) * np.exp(-1j * phase))), 0.5, 0.1)


# ---- chips and controllers


@DETECT.look("chip.drdy_stuck")
def no_drdy(c: Case) -> None:
    for level in ("high", "low"):
        c.add(level=level)
        before = c.watch(0.6)
        late = c.watch(0.1)
        assert 0xFF01 in before.emcy or len(set(late.codes(0))) <= 1
        assert not late.at_s or level == "low"
        c.clear()
        c.reset()


@DETECT.look("chip.dout_dead")
def dead_dout(c: Case) -> None:
    for level in ("high", "low"):
        c.add(level=level)
        s = c.settled(0.2)
        if c.board is BOARDS["psd1"]:
            assert set(s.codes(c.axis)) == {65535.0 if level == "high" else 0.0}
        elif c.board is BOARDS["pmka"]:
            for axis in range(3):
                assert set(np.round(s.codes(axis) / 10 * 2**15)) == {-1.0 if level == "high" else 0.0}
        else:
            assert set(s.codes(c.axis)) == {0.0}
        c.clear()


@DETECT.look("chip.clock")
def clock(c: Case) -> None:
    before = c.settled()
    if c.board is BOARDS["pik"]:  # pulses are worth its periods, and readings come by them
        c.add(clock_ppm=-20000)
        slow = c.settled()
        rates = (len(slow.at_s) / len(before.at_s), slow.mean_v(0) / before.mean_v(0))
        assert max(abs(rate - 1) for rate in rates) > 0.01, rates
    elif c.axis == 0:
        c.add(clock_ppm=-20000)
        near(float(np.diff(c.settled().at_s).mean() / np.diff(before.at_s).mean()), 1 / 0.98, 2e-3)
    else:  # it is read when X is ready, less often than it has a word
        name = f"Lost {c.point[-1].upper()}"
        counters = c.host.units[c.unit].counters
        lost = counters()[name]
        c.settled()
        assert counters()[name] == lost
        c.add(clock_ppm=20000)
        s = c.settled()
        assert counters()[name] > lost + 5
        assert s.column("PSD1_CYCLE", "OVERRUN").any()


@DETECT.look("chip.flip")
def flip(c: Case) -> None:
    if c.board is BOARDS["psd1"]:
        node, axis = c.host.units[c.unit].node, c.axis + 1
        before = node.read_raw(0x2046, axis)
        c.add(register=2, mask=0x01)
        assert node.read_raw(0x2046, axis) == bytes((before[0] ^ 0x01, *before[1:]))
    elif c.board is BOARDS["pmka"]:
        c.write(13, 0x101)  # word 1 of the ROM: the serial number
        word = c.read(14)
        c.add(register=2, mask=0x01)
        c.write(13, 0x101)
        assert c.read(14) == word ^ 0x01
        c.add(register=2, mask=0x01)
    else:
        message = "PIK_TOTAL_Z" if c.axis == 2 else "PIK_TOTALS"
        total = c.watch(0.02).rows[message][-1]["XYZ"[c.axis]]
        c.add(register=1, mask=0x80)
        assert abs(abs(c.watch(0.02).rows[message][-1]["XYZ"[c.axis]] - total) - 0x8000) < 1000


@DETECT.look("controller.frozen_words")
def frozen_words(c: Case) -> None:
    c.host.turn(0.0)
    c.host.bus.advance(SETTLE_S)
    c.add()
    c.watch(0.02)
    c.host.turn(90.0)
    s = c.watch()
    assert (s.steps() == 1).all()
    for axis in range(3):
        assert len(set(s.codes(axis))) == 1
    c.host.turn(30.0)


@DETECT.look("controller.capacitor")
def capacitor(c: Case) -> None:
    """Without a reset the code of X grows by more, for the same volts."""

    def slope() -> float:
        s = c.settled()
        quiet = s.column("PMKA_STATE", "RESET_X")[1:] == 0
        return float(np.diff(s.codes(0))[quiet].mean())

    before = slope()
    c.add()
    near(slope() / before, 1 / 0.7, 0.01)


@DETECT.look("controller.stuck_reset")
def stuck_reset(c: Case) -> None:
    assert not c.settled().column("PMKA_STATE", "SATURATED").any()
    c.add()
    assert (c.settled().column("PMKA_STATE", "SATURATED").astype(int) & 1).all()


@DETECT.look("controller.stuck_key")
def stuck_key(c: Case) -> None:
    """With the board's own rotation K takes an axis now and then; its code moves then."""

    def moved() -> float:
        s = c.watch(6.0)
        serves = s.column("PMKA_STATE", "SERVES_K")[1:] > 0
        still = s.column("PMKA_STATE", "RESET_K")[1:] == 0
        steps = np.abs(np.diff(s.column("PMKA_CODES", "K")))
        assert serves.sum() > 50
        return float(np.median(steps[serves & still]))

    c.write(9, 1)
    assert moved() > 0.1
    c.add()
    assert moved() < 0.01


# ---- links and supply


@DETECT.look("link.drop")
def drop(c: Case) -> None:
    c.add(probability=0.3)
    assert "numbers" in c.watch().complaints()


@DETECT.look("link.duplicate")
def duplicate(c: Case) -> None:
    c.add(probability=0.3)
    assert c.watch().repeated > 5


@DETECT.look("link.reorder")
def reorder(c: Case) -> None:
    c.add(probability=0.5, hold_s=0.02, can_id=c.board.numbered_id + c.host.node[c.unit])
    s = c.watch()
    assert "numbers" in s.complaints()
    assert max(s.steps()) > s.board.wraps / 2, "some come after their successors"


@DETECT.look("link.delay")
def delay(c: Case) -> None:
    last_s = c.watch(0.1).at_s[-1]
    c.add(hold_s=0.02)  # of all boards that is less than the 64 frames that are kept
    s = c.watch(0.2)
    assert s.at_s[0] - last_s > 0.02
    assert (s.steps() == 1).all()


@DETECT.look("link.corrupt")
def corrupt(c: Case) -> None:
    c.add()
    s = c.watch()
    jumps = max(float(np.abs(np.diff(s.volts(axis))).max()) for axis in range(3))
    assert (s.steps() != 1).any() or jumps > 5.0
    assert not s.errors


@DETECT.look("link.error_frame")
def error_frame(c: Case) -> None:
    c.add(probability=0.2)
    s = c.watch()
    assert s.errors > 5
    assert (s.steps() == 1).all(), "what was destroyed is sent again"


@DETECT.look("link.bus_off")
def bus_off(c: Case) -> None:
    begun_s = c.host.bus.clock.now_s()
    c.add()
    s = c.watch(0.1)
    assert s.at_s[0] - begun_s > 128 * 11e-6
    assert (s.steps() == 1).all(), "its frames have waited"


@DETECT.look("link.stall")
def stall(c: Case) -> None:
    c.add()
    assert not c.watch(0.05).at_s
    c.clear()
    assert len(c.watch(0.01).at_s) > 40


@DETECT.look("supply.brownout")
def brownout(c: Case) -> None:
    c.add(drop_v=6, for_s=0.02)
    c.host._kept.clear()
    c.host.bus.advance(0.1)
    for unit, board in boards(c.host).items():
        assert seen(c.host, unit, BOARDS[board]).boots == 1, unit
    c.host.start()
    for unit, board in boards(c.host).items():
        c.host._kept.clear()
        c.host.bus.advance(SETUP_S)
        assert seen(c.host, unit, BOARDS[board]).numbers(), unit


ELSEWHERE = ("line.", "head.", "scpi.")  # test_faults_boards_lines.py, test_faults_instruments.py
NEEDED: dict[str, dict[str, object]] = VALUES | {
    "sensor.scale": {"scale_ppm": 1e5},
    "analog.reference": {"reference_ppm": 1e4},
}


def test_each_kind_is_taken_where_it_can_be_seen_and_refused_elsewhere() -> None:
    with fault_host(SCENARIO) as host:
        points = host.call("fault.points")["points"]
        for kind in (k["kind"] for k in host.call("fault.kinds")["kinds"]):
            for point in points:
                want = must_accept(ACCEPTED, kind, point)
                assert accepted(Case(host, kind, point), NEEDED) == want, f"{kind} at {point}"
            if kind not in DETECT and not kind.startswith(ELSEWHERE):
                assert not any(must_accept(ACCEPTED, kind, point) for point in points), f"no test looks for {kind}"


@pytest.mark.parametrize("kind", DETECT)
def test_what_is_taken_is_seen(kind: str) -> None:
    with fault_host(SCENARIO) as host:
        host.turn(30.0)  # every axis feels something
        host.bus.advance(SETUP_S)
        for point in host.call("fault.points")["points"]:
            c = Case(host, kind, point)
            if not must_accept(ACCEPTED, kind, point):
                continue
            DETECT[kind](c)
            c.clear()
            if not kind.startswith(("sensor", "analog")):
                for unit in host.node:
                    host.reset(unit)
                host.bus.advance(SETUP_S)
            assert c.settled(0.1).complaints() == [], f"{kind} at {point} is over"
