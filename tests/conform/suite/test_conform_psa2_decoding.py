"""SPI bursts, messages and pairs from hand-made edges and frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from psabench.boards.psa2.conform.capture_can import aligned, pairs, segment, signed
from psabench.boards.psa2.conform.capture_spi import PINS, traffic
from psabench.conform.capture.log import CanFrame, CanLog, Capture, LineLog
from psabench.conform.profile import variant
from psabench.conform.verdict import Failed, Inconclusive
from psabench.link.signals import Ints
from psabench.link.vcd import Vcd, Wire

T = 1000  # ns a period of SClk
HZ = 1e9 / T


class Pins:
    """Lines under the test's hand."""

    def __init__(self) -> None:
        self.edges: dict[str, list[tuple[int, int]]] = {p: [(0, int(p in ("CST", "Res")))] for p in PINS}

    def set(self, pin: str, at_ns: int, level: int) -> None:
        self.edges[pin].append((at_ns, level))

    def burst(self, at_ns: int, sent: int, bits: int, *, temp: bool = False, got: int = 0) -> int:
        """MSB first, mode 0 or mode 1; returns the end."""
        line, answer = ("DInT", "DOutT") if temp else ("DIn", "DOutX")
        for k in range(bits):
            rise, fall = at_ns + k * T, at_ns + k * T + T // 2
            change = rise if temp else rise - T // 2
            self.set(line, change, sent >> (bits - 1 - k) & 1)
            self.set(answer, change, got >> (bits - 1 - k) & 1)
            self.set("SClk", rise, 1)
            self.set("SClk", fall, 0)
        return at_ns + bits * T

    def log(self) -> LineLog:
        end = max(t for e in self.edges.values() for t, _ in e) + 10 * T
        return LineLog(recording=Vcd(1, 0, end, {p: self._wire(p) for p in PINS}))

    def _wire(self, pin: str) -> Wire:
        found = sorted(self.edges[pin], key=lambda e: e[0])
        keep = [e for k, e in enumerate(found) if k == 0 or e[1] != found[k - 1][1]]
        t, v = zip(*keep, strict=True)
        return Wire(np.array(t, np.int64), np.array(v, np.uint8))


def test_commands_come_byte_by_byte_and_reads_in_one_burst() -> None:
    p = Pins()
    at = 10 * T
    for byte in (0x41, 0x00, 0x56):
        at = p.burst(at, byte, 8) + 6 * T
    at = p.burst(at + 50 * T, 0, 24, got=0x123456)
    p.burst(at + 50 * T, 0x11, 8)
    t = traffic(p.log(), HZ)
    assert [m.name for m in t.of(temp=False)] == ["41 00 56", "11"]
    assert [(b.bits, int(b.got[0], 2)) for b in t.reads] == [(24, 0x123456)]


def test_a_register_read_has_its_answer() -> None:
    p = Pins()
    at = 10 * T
    for byte, got in ((0x11, 0), (0x22, 0), (0x00, 0), (0x00, 0xA5), (0x10, 0)):
        at = p.burst(at, byte, 8, got=got) + 6 * T
    found = traffic(p.log(), HZ).of(temp=False)
    assert [m.name for m in found] == ["11", "22 00 00", "10"]
    assert found[1].got[0][2] == 0xA5


def test_one_low_of_cst_is_one_message_in_mode_1() -> None:
    p = Pins()
    p.set("CST", 9 * T, 0)
    at = p.burst(10 * T, 0x01, 8, temp=True) + 7 * T
    at = p.burst(at, 0, 24, temp=True, got=0x4C538E)
    p.set("CST", at + T, 1)
    p.set("CST", at + 20 * T, 0)
    at = p.burst(at + 21 * T, 0x510018, 24, temp=True)
    p.set("CST", at + T, 1)
    found = traffic(p.log(), HZ).of(temp=True)
    assert [m.name for m in found] == ["01 00 00 00", "51 00 18"]
    assert found[0].got[0][1:] == b"\x4c\x53\x8e"
    assert not traffic(p.log(), HZ).of(temp=False)


def test_what_is_cut_is_decoded_as_far_as_it_goes() -> None:
    p = Pins()
    p.burst(p.burst(10 * T, 0x41, 8) + 6 * T, 0x05, 5)
    found = traffic(p.log(), HZ).of(temp=False)
    assert sum(b.bits for m in found for b in m.bursts) == 13


def test_a_recording_without_a_pin_or_without_a_clock_is_too_little() -> None:
    log = Pins().log()
    with pytest.raises(Inconclusive, match="SClk never rises"):
        traffic(log, HZ)
    wires = {n: w for n, w in log.recording.wires.items() if n != "DIn"}
    with pytest.raises(Inconclusive, match="no line DIn"):
        traffic(replace(log, recording=Vcd(1, 0, 100, wires)), HZ)


def log_of(samples: list[tuple[int, int]], node: int = 5) -> Capture:
    """Samples (SEQ, TSTAMP) with codes SEQ, -SEQ, 2 SEQ."""
    found = []
    for seq, stamp in samples:
        code = [v & 0xFFFFFF for v in (seq, -seq, 2 * seq)]
        xy = (code[0] | code[1] << 24 | (seq & 0xFFFF) << 48).to_bytes(8, "little")
        zt = (code[2] | 19539 << 24 | 0x31 << 40 | (stamp & 0xFFFF) << 48).to_bytes(8, "little")
        t_s = seq * 1e-3
        found += [CanFrame(t_s=t_s, can_id=0x180 + node, data=xy), CanFrame(t_s=t_s, can_id=0x280 + node, data=zt)]
    return Capture(variant=variant("psa2"), node=node, stimulus="", can=CanLog(frames=tuple(found)))


def test_pairs_are_arrays_with_stamps_unwrapped() -> None:
    p = pairs(log_of([(k, 65_500 + 250 * k) for k in range(65_530, 65_560)]), 10)
    assert len(p) == 30
    assert (p.steps == 1).all()
    assert (np.diff(p.stamp) == 250).all()
    assert (p.code[3] == [65_533, -65_533, 131_066]).all()
    assert (p.temp == 19539).all()
    assert (p.channel == 3).all()
    assert p.settled.all()
    assert not p.clip.any()


def test_halves_alone_are_left_out_and_short_ones_broken() -> None:
    e = log_of([(k, k) for k in range(30)])
    alone = e.with_can(CanLog(frames=e.can.frames[1:-1]))
    assert len(pairs(alone)) == 28
    cut = e.with_can(CanLog(frames=(e.can.frames[0]._replace(data=b"\0"), *e.can.frames[1:])))
    with pytest.raises(Failed, match="expected 8 bytes, got 1"):
        pairs(cut)
    with pytest.raises(Inconclusive, match="0 samples"):
        pairs(e.with_can(CanLog()))


def test_another_node_is_not_ours() -> None:
    e = log_of([(k, k) for k in range(30)], node=9)
    with pytest.raises(Inconclusive):
        pairs(replace(e, node=5))


def test_a_segment_wants_its_cut() -> None:
    e = replace(log_of([(k, k) for k in range(30)]), facts={"cut": {"a": 0, "b": 10}})
    assert len(segment(e, "a", "b").can) == 10
    with pytest.raises(Inconclusive, match="no cut c"):
        segment(e, "c")


def column(*values: int) -> Ints:
    return np.array(values, np.int64)[:, None]


def test_logs_are_laid_beside_each_other_where_most_agrees() -> None:
    assert aligned(column(1, 2, 3, 4, 5), column(3, 4, 9)) == (2, 2)
    assert aligned(column(3, 4), column(1, 2, 3, 4)) == (-2, 2)
    assert aligned(column(1), column(2)) == (0, 0)
    assert aligned(column(), column(2)) == (0, 0)


def test_twos_complement() -> None:
    assert signed(np.array([0, 0x7FFFFF, 0x800000, 0xFFFFFF]), 24).tolist() == [0, 8388607, -8388608, -1]
