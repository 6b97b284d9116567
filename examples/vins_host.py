"""A navigation computer's end of one PSA-2 on CAN, which tells what it takes as docs/conform_host.md says.

psabench conform host --command ".venv/bin/python examples/vins_host.py socketcand:{can} {node} {form}"
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np
from psabench.boards.psa2.frames import FrameReader
from psabench.errors import DeviceError, LinkError
from psabench.link.can_host import CanHost, Message, WallClock, open_bus
from psabench.link.canopen_host import CanopenNode
from psabench.places import proto_file

CODE_V = 10.0 / 2**23
NOT_NOW = 0x08000022
SETUP = {(0x2000, 2): (0xFF, 0x56), (0x2003, 2): (0xFF, 0x56), (0x2004, 2): (0xFF, 0x56)}  # CONFIG0: what counts, value
SETUP |= {(0x2001, 1): (0x04, 0x04), (0x2001, 4): (0xFF, 0x82)}  # STATUS, DRATE
STALE_S, GONE_S, FROZEN, RATE_FRAMES, RATE_PPM = 0.25, 3.5, 1000, 500, 1000
TICKS, WRAP = 250, 1 << 16  # of TSTAMP: in a data period, and before it begins again


class Host:
    """State of one board as this host knows it."""

    def __init__(self, bus: CanHost, node: int, form: int) -> None:
        self.bus, self.node, self.form = bus, node, form
        self.objects = CanopenNode(bus, node, proto_file("psa2.eds"))
        self.beat_s = time.monotonic()
        self.gone = self.started = self.again = False
        self.forget()
        bus.listeners.append(self.on_message)

    def forget(self) -> None:
        """The board has begun again, or is new to us."""
        self.reader = FrameReader(self.node)
        self.torn = self.told_torn = self.told_lost = self.told_overruns = self.odd = self.same = 0
        self.xy, self.zt, self.stale, self.frozen = b"", b"", False, False
        self.base: tuple[int, int] | None = None  # SEQ and TSTAMP of the last pair
        self.seq: int | None = None
        self.codes = np.zeros(3, dtype=np.int64)
        self.over = [False] * 3
        self.marks: list[tuple[int, float]] = []  # number and instant of samples, for the data rate
        self.count, self.sample_s = 0, time.monotonic()

    def tell(self, **what: Any) -> None:
        """Samples that have come first: the order says when."""
        self.take()
        print(json.dumps(what))

    def set_up(self) -> bool:
        """Wait for the board's set-up, read it and start the stream; False when it is not the article's."""
        self.objects.read(0x1018, 1)
        for (index, sub), (mask, due) in SETUP.items():
            while True:
                try:
                    value = self.objects.read(index, sub)
                    break
                except DeviceError as e:
                    if e.abort_code != NOT_NOW:
                        raise
                    self.bus.advance(0.02)
            if value & mask != due:
                self.tell(wrong_setup=f"{index:04X}h:{sub} is {value:02X}h")
                return False
        if self.form:
            self.objects.write(0x2020, 0, self.form)
        self.forget()
        self.started, self.again = True, False
        self.objects.nmt(0x01)
        return True

    def on_message(self, m: Message) -> None:
        service, data = m.arbitration_id - self.node, bytes(m.data)
        if m.is_error_frame:
            return
        if service == 0x080 and len(data) == 8:
            self.tell(emcy=int.from_bytes(data[:2], "little"))
        elif service == 0x700:
            self.beat_s, self.gone = time.monotonic(), False
            if data == b"\0" and self.started:
                self.tell(restart=True)
                self.started, self.again = False, True
        elif self.started and (service == 0x380 or (service in (0x180, 0x280) and self.is_right(service, data))):
            self.reader.on_message(m)

    def is_right(self, service: int, data: bytes) -> bool:
        """Neither come twice nor the half of another sample; the reader counts the rest."""
        before, self.xy = self.xy, data if service == 0x180 else b""
        if service == 0x180 or len(data) != 8 or len(before) != 8:
            again = data == (before if service == 0x180 else self.zt)
            self.xy = before if service == 0x180 and again else self.xy
            return not again
        self.zt = data
        if self.stale:
            self.tell(stale=False)
        seq, stamp = (int.from_bytes(d[6:8], "little") for d in (before, data))
        steps = (seq - self.base[0]) % WRAP if self.base else 0
        off = (stamp - self.base[1] - steps * TICKS + WRAP // 2) % WRAP - WRAP // 2 if self.base else 0
        odd = self.base is not None and (steps > WRAP // 2 or (not self.stale and abs(off) > 200 + steps / 2))
        self.odd = self.odd + 1 if odd else 0
        repeated = self.base is not None and steps == 0
        self.stale, self.sample_s = False, time.monotonic()
        if repeated or (odd and self.odd < 8):
            self.torn += not repeated
            self.reader.forget_half()
            return False
        self.base = (seq, stamp)
        return True

    def take(self) -> None:
        """Tell the samples that have come, and what is to be said of them."""
        frames = self.reader.take()
        codes = np.rint(frames.u_v / CODE_V).astype(np.int64)
        if self.form:
            self.take_fast(codes >> 3)
            return
        for i in range(len(frames)):
            seq = int(frames.seq[i])
            steps = 1 if self.seq is None else (seq - self.seq) % WRAP
            if steps > 1:
                print(json.dumps({"lost": steps - 1}))
            self.seq = seq
            self.count += steps
            self.watch_rate(float(frames.t_sample_s[i]))
            if frames.settled[i]:
                self.watch(codes[i])
                sample = {"frame": seq, **{n: int(c) for n, c in zip("xyz", codes[i], strict=True)}}
                sample |= {"t": int(frames.temp_code[i]), "channel": int(frames.temp_channel[i])}
                print(json.dumps(sample | {"t_us": float(frames.t_sample_s[i]) * 1e6, "v": frames.u_v[i].tolist()}))
        self.tell_counts()

    def take_fast(self, codes: np.ndarray[Any, np.dtype[np.int64]]) -> None:
        """Frames of form 1 have no number of their own; what is missing between two is reported by TOG."""
        if lost := self.reader.counters.lost - self.told_lost:
            print(json.dumps({"lost": lost}))
        self.told_lost += lost
        for x, y, z in codes.tolist():
            print(json.dumps({"reading": self.count, "x": x, "y": y, "z": z}))
            self.count += 1

    def tell_counts(self) -> None:
        torn, overruns = self.torn + self.reader.counters.torn, self.reader.counters.overruns
        for name, n in (("torn", torn - self.told_torn), ("overrun", overruns - self.told_overruns)):
            if n:
                print(json.dumps({name: n}))
        self.told_torn, self.told_overruns = torn, overruns

    def watch(self, codes: np.ndarray[Any, np.dtype[np.int64]]) -> None:
        """Codes at their limits, and codes that do not change."""
        for i, code in enumerate(codes):
            if (code in (0x7FFFFF, -0x800000)) != self.over[i]:
                self.over[i] = not self.over[i]
                print(json.dumps({"over_range" if self.over[i] else "in_range": "xyz"[i]}))
        self.same = self.same + 1 if (codes == self.codes).all() else 1
        self.codes = codes
        if self.frozen != (self.same >= FROZEN):
            self.frozen = not self.frozen
            print(json.dumps({"frozen": self.frozen}))

    def watch_rate(self, t_s: float) -> None:
        """The data rate by the board's own times, over spans without a silence."""
        if self.marks and t_s - self.marks[-1][1] > 0.1:
            self.marks.clear()
        self.marks = [*self.marks[:1], (self.count, t_s)]
        (n0, t0_s), (n1, t1_s) = self.marks[0], self.marks[-1]
        if n1 - n0 >= RATE_FRAMES:
            ppm = ((t1_s - t0_s) / (n1 - n0) / 1e-3 - 1.0) * 1e6
            if abs(ppm) > RATE_PPM:
                print(json.dumps({"rate_ppm": round(ppm)}))
            self.marks.clear()

    def look_at_the_clock(self) -> None:
        now_s = time.monotonic()
        if self.started and self.base and not self.stale and now_s - self.sample_s > STALE_S:
            self.tell(stale=True)
            self.stale = True
        if not self.gone and now_s - self.beat_s > GONE_S:
            self.tell(gone=True)
            self.gone = True


def main() -> int:
    with CanHost(open_bus(sys.argv[1]), WallClock()) as bus:
        host = Host(bus, int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0)
        try:
            host.set_up()
            while True:
                came = bus.receive(0.01)
                for _ in range(200):  # decode many at a time, but do not keep them long
                    came = came and bus.receive(0.0)
                host.take()
                host.look_at_the_clock()
                if host.again:
                    host.set_up()
                sys.stdout.flush()
        except LinkError:
            host.tell(end=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
