"""Every kind of fault at every point of the other boards: refused with the reason, or seen on the wire.

As test_faults.py does for PSA-2, by a host that knows the pages alone. What lines show is compared with a recording
of the same bench without the fault: a fault of a line changes that line and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from fault_boards import BOARDS, Board, Seen, seen
from fault_case import VALUES, FaultCase, accepted, must_accept, near
from fault_host import Host, fault_host
from psabench.vcd import Vcd, read_vcd
from rig import HERE

pytestmark = pytest.mark.host

SCENARIO = HERE / "faults_boards.yaml"
SETTLE_S = 0.05
SETUP_S = 0.5
LOOK_S = 0.5
RECORD_S = 0.05
BEFORE_NS = 200_000  # by which a recording begins before its command: what is reported late belongs to it


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


TOLERANCE_V = 5e-3  # PIK-6: a pulse in half a second is 1 mV; PMKA: what the period cuts off


# ---- sensors and analog chain


def sensor_stuck(c: Case) -> None:
    healthy = c.turned_v()
    assert abs(healthy[1] - healthy[0]) > 0.1, "the head turns, the axis feels it"
    c.host.turn(90.0)
    c.add()
    for v in c.turned_v():
        near(v, healthy[1], TOLERANCE_V)


def sensor_bias(c: Case) -> None:
    before_v = c.mean_v()
    c.add(bias_v=0.1)
    near(c.mean_v() - before_v, 0.1, TOLERANCE_V)


def sensor_drift(c: Case) -> None:
    c.add(drift_v_per_s=0.5)
    first = c.settled().mean_v(c.axis)
    near((c.watch().mean_v(c.axis) - first) / LOOK_S, 0.5, 0.02)


def sensor_scale(c: Case) -> None:
    healthy = c.turned_v()
    c.add(scale_ppm=100000)
    wrong = c.turned_v()
    near((wrong[1] - wrong[0]) / (healthy[1] - healthy[0]), 1.1, 0.02)


def sensor_noise(c: Case) -> None:
    before_v = c.settled().volts(c.axis).std()
    c.add(rms_v=0.5)
    assert c.settled().volts(c.axis).std() > before_v + 0.1


def sensor_saturation(c: Case) -> None:
    limit_v = c.mean_v() - 0.25
    c.add(high_v=limit_v)
    near(c.mean_v(), limit_v, TOLERANCE_V)


def load_open(c: Case) -> None:
    c.add()
    assert c.settled().mean_v(c.axis) > 0.95 * c.board.full_v


def load_short(c: Case) -> None:
    assert abs(c.mean_v()) > 0.1
    c.add()
    near(c.mean_v(), 0.0, TOLERANCE_V)


def reference(c: Case) -> None:
    before_v = c.mean_v()
    c.add(reference_ppm=10000)
    near(c.mean_v() / before_v, 1 / 1.01, 3e-3)


def ripple(c: Case) -> None:
    """20 Hz over ten of its periods."""
    c.add(amplitude_v=0.5, frequency_hz=20)
    volts = c.settled().volts(c.axis)
    phase = 2 * np.pi * np.arange(len(volts)) * 20 * c.board.period_s
    near(2 * abs(np.mean((volts - volts.mean()) * np.exp(-1j * phase))), 0.5, 0.1)


# ---- chips and controllers


def no_drdy(c: Case) -> None:
    for level in ("high", "low"):
        c.add(level=level)
        before = c.watch(0.6)
        late = c.watch(0.1)
        assert 0xFF01 in before.emcy or len(set(late.codes(0))) <= 1
        assert not late.at_s or level == "low"
        c.clear()
        c.reset()


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


def capacitor(c: Case) -> None:
    """Without a reset the code of X grows by more, for the same volts."""

    def slope() -> float:
        s = c.settled()
        quiet = s.column("PMKA_STATE", "RESET_X")[1:] == 0
        return float(np.diff(s.codes(0))[quiet].mean())

    before = slope()
    c.add()
    near(slope() / before, 1 / 0.7, 0.01)


def stuck_reset(c: Case) -> None:
    assert not c.settled().column("PMKA_STATE", "SATURATED").any()
    c.add()
    assert (c.settled().column("PMKA_STATE", "SATURATED").astype(int) & 1).all()


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


def drop(c: Case) -> None:
    c.add(probability=0.3)
    assert "numbers" in c.watch().complaints()


def duplicate(c: Case) -> None:
    c.add(probability=0.3)
    assert c.watch().repeated > 5


def reorder(c: Case) -> None:
    c.add(probability=0.5, hold_s=0.02, can_id=c.board.numbered_id + c.host.node[c.unit])
    s = c.watch()
    assert "numbers" in s.complaints()
    assert max(s.steps()) > s.board.wraps / 2, "some come after their successors"


def delay(c: Case) -> None:
    last_s = c.watch(0.1).at_s[-1]
    c.add(hold_s=0.02)  # of all boards that is less than the 64 frames that are kept
    s = c.watch(0.2)
    assert s.at_s[0] - last_s > 0.02
    assert (s.steps() == 1).all()


def corrupt(c: Case) -> None:
    c.add()
    s = c.watch()
    jumps = max(float(np.abs(np.diff(s.volts(axis))).max()) for axis in range(3))
    assert (s.steps() != 1).any() or jumps > 5.0
    assert not s.errors


def error_frame(c: Case) -> None:
    c.add(probability=0.2)
    s = c.watch()
    assert s.errors > 5
    assert (s.steps() == 1).all(), "what was destroyed is sent again"


def bus_off(c: Case) -> None:
    begun_s = c.host.bus.clock.now_s()
    c.add()
    s = c.watch(0.1)
    assert s.at_s[0] - begun_s > 128 * 11e-6
    assert (s.steps() == 1).all(), "its frames have waited"


def stall(c: Case) -> None:
    c.add()
    assert not c.watch(0.05).at_s
    c.clear()
    assert len(c.watch(0.01).at_s) > 40


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


# ---- lines


def record(host: Host, unit: str) -> Vcd:
    path = host.emulator.directory / "lines.vcd"
    host.call("vcd.start", path=str(path), unit=unit)
    host.bus.advance(RECORD_S)
    host.call("vcd.stop")
    return read_vcd(path)


@cache
def healthy(unit: str) -> Vcd:
    """The same bench with no fault, at the same instant: what a fault of a line is compared with."""
    with fault_host(SCENARIO) as host:
        host.bus.advance(SETUP_S)
        return record(host, unit)


def line_case(kind: str, unit: str, names: list[str], **args: object) -> tuple[Vcd, Vcd]:
    """Recordings of a unit without and with a fault of some lines; the others are the same."""
    with fault_host(SCENARIO) as host:
        host.bus.advance(SETUP_S)
        for name in names:
            host.add(kind, f"{unit}.line.{name}", **args)
        wrong = record(host, unit)
    right = healthy(unit)
    for other, wire in right.wires.items():
        if other not in names:
            assert np.array_equal(known(right, wire.t_ns), known(wrong, wrong.wires[other].t_ns)), other
    return right, wrong


def known(v: Vcd, t_ns: np.ndarray) -> np.ndarray:
    """Instants from that of the command on; the recording begins BEFORE_NS earlier, with lines as they were."""
    return t_ns[t_ns > v.start_ns + BEFORE_NS]


def differ(right: Vcd, wrong: Vcd, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Instants at which either recording of a line has an edge, and whether the two differ from there on."""
    edges_ns = np.concatenate([right.wires[name].t_ns, wrong.wires[name].t_ns])
    at_ns = np.unique(np.concatenate([[right.start_ns + BEFORE_NS], known(right, edges_ns)]))
    return at_ns, right.wires[name].at(at_ns) != wrong.wires[name].at(at_ns)


def line_stuck(unit: str, names: list[str]) -> None:
    for level in (0, 1):
        _, wrong = line_case("line.stuck", unit, names, level=("low", "high")[level])
        at_ns = np.arange(wrong.start_ns + BEFORE_NS, wrong.end_ns, 99_991)
        for name in names:
            assert (wrong.wires[name].at(at_ns) == level).all(), name


def line_swapped(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.swapped", unit, names)
    for name in names:
        assert differ(right, wrong, name)[1].all(), name


def line_glitch(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.glitch", unit, names, width_ns=150)
    for name in names:
        at_ns, other = differ(right, wrong, name)
        edges = np.flatnonzero(np.diff(other.astype(int), prepend=0))
        assert len(edges) == 2, name
        assert at_ns[edges[1]] - at_ns[edges[0]] == 150, name


def line_noise(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.noise", unit, names, rate_hz=2000, width_ns=100)
    for name in names:
        other = differ(right, wrong, name)[1]
        assert 40 < np.count_nonzero(np.diff(other.astype(int)) == 1) < 200, f"100 are due on {name}"


def pulses(v: Vcd, name: str) -> int:
    return len(v.wires[name].edges_ns(1))


FRAMES = {"d": "RFX", "m": "MUX1"}  # whose falls begin a frame


def line_missing_pulse(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.missing_pulse", unit, names, pulse=3)
    frames = len(right.wires[FRAMES[unit]].edges_ns(0))
    near(pulses(right, names[0]) - pulses(wrong, names[0]), frames, 1)


def line_extra_pulse(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.extra_pulse", unit, names, pulse=3, width_ns=100)
    frames = len(right.wires[FRAMES[unit]].edges_ns(0))
    near(pulses(wrong, names[0]) - pulses(right, names[0]), frames, 1)


DETECT: dict[str, Callable[[Case], None]] = {
    "sensor.stuck": sensor_stuck,
    "sensor.bias": sensor_bias,
    "sensor.drift": sensor_drift,
    "sensor.scale": sensor_scale,
    "sensor.noise": sensor_noise,
    "sensor.saturation": sensor_saturation,
    "analog.load_open": load_open,
    "analog.load_short": load_short,
    "analog.reference": reference,
    "analog.ripple": ripple,
    "chip.drdy_stuck": no_drdy,
    "chip.dout_dead": dead_dout,
    "chip.clock": clock,
    "chip.flip": flip,
    "controller.frozen_words": frozen_words,
    "controller.capacitor": capacitor,
    "controller.stuck_reset": stuck_reset,
    "controller.stuck_key": stuck_key,
    "link.drop": drop,
    "link.duplicate": duplicate,
    "link.reorder": reorder,
    "link.delay": delay,
    "link.corrupt": corrupt,
    "link.error_frame": error_frame,
    "link.bus_off": bus_off,
    "link.stall": stall,
    "supply.brownout": brownout,
}
DETECT_LINE: dict[str, Callable[[str, list[str]], None]] = {
    "line.stuck": line_stuck,
    "line.swapped": line_swapped,
    "line.glitch": line_glitch,
    "line.noise": line_noise,
    "line.missing_pulse": line_missing_pulse,
    "line.extra_pulse": line_extra_pulse,
}

# What must be accepted; everything else must be refused.
ACCEPTED = {
    "sensor": r"[dmp]\.sensor\.[xyz]",
    "analog.load_open": r"[dmp]\.afe\.z",
    "analog.load_short": r"[dmp]\.afe\.z",
    "analog": r"[dmp]\.afe\.[xyz]",
    "chip.drdy_stuck": r"d\.adc\.x",
    "chip.dout_dead": r"d\.adc\.[xyz]|m\.adc|p\.conv\.[xyz]",
    "chip.lost_sync": r"none",
    "chip.clock": r"d\.adc\.[xyz]|p\.clock",
    "chip.flip": r"d\.adc\.[xyz]|m\.rom|p\.conv\.[xyz]",
    "controller.frozen_words": r"d\.kpsd|[mp]\.controller",
    "controller.skip_sync_t": r"none",
    "controller.setup_order": r"none",
    "controller": r"m\.controller",
    "line.missing_pulse": r"d\.line\.SCLK|m\.line\.CONV",
    "line.extra_pulse": r"d\.line\.SCLK|m\.line\.CONV",
    "line": r"[dmp]\.line\..*",
    "link.error_frame": r"[dmp]\.can|bus\.can0",
    "link.bus_off": r"[dmp]\.can",
    "link.stall": r"client\.\d+",
    "link": r"[dmp]\.can|bus\.can0|client\.\d+",
    "supply": r"supply",
}
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
            if kind not in DETECT and kind not in DETECT_LINE:
                assert not any(must_accept(ACCEPTED, kind, point) for point in points), f"nobody looks for {kind}"


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


@cache
def lines(unit: str) -> list[str]:
    with fault_host(SCENARIO, settle=False) as host:
        points = host.call("fault.points")["points"]
    return [p.rpartition(".")[2] for p in points if p.startswith(f"{unit}.line.")]


@pytest.mark.parametrize("kind", DETECT_LINE)
@pytest.mark.parametrize("unit", "dmp")
def test_a_fault_of_a_line_is_in_the_recording_and_nowhere_else(unit: str, kind: str) -> None:
    names = [name for name in lines(unit) if must_accept(ACCEPTED, kind, f"{unit}.line.{name}")]
    for some in (names[::2], names[1::2]):  # the others stay as they are
        if some:
            DETECT_LINE[kind](unit, some)
