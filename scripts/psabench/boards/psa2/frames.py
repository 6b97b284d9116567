"""PSA-2 frames from CAN: pairs, fast form, FD frames and FD blocks, as arrays in SI.

Raw integers end here. `FrameReader` listens to a `CanHost`, keeps the bytes of its node's frames and counts what is
wrong with them; `take` turns what has arrived into one `Frames`. What counts as lost: `boards.stream`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cache, partial

import numpy as np
import numpy.typing as npt

from psabench.boards.registry import DBC_NODE
from psabench.boards.stream import FrameCounters, NodeState, by_stretch, missing_counts
from psabench.link import signals
from psabench.link.can_host import Message
from psabench.link.protocol_files import message
from psabench.link.signals import Floats, Ints


class Form(IntEnum):
    """Object 2020h: how a sample travels."""

    PAIR = 0  # two classic frames, 24-bit codes
    FAST = 1  # one classic frame, 21-bit codes
    FRAME = 2  # one FD frame
    BLOCK = 3  # five samples in an FD frame


WHOLE = (Form.FAST, Form.FRAME, Form.BLOCK)  # a sample, or a block of them, is one message
SAMPLE_MESSAGES = ("PSA2_XY", "PSA2_ZT", *(f"PSA2_{form.name}" for form in WHOLE))
TEMP_CODES_PER_K = 65.536  # 1 uA/K on 10 kohm, 16 bits of +-5 V (PSA2-TEMP-04)
KELVIN_DEGC = -273.15  # of 0 K


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """n samples. Times are NaN, `seq` -1, temperatures and flags absent (0) where the form does not carry them."""

    t_rx_s: Floats  # (n,) when the (last) CAN frame arrived, in the time of the transport
    t_sample_s: Floats  # (n,) instant of the sample, s since power-on modulo the form's time stamp, unwrapped
    seq: Ints  # (n,) frame number since Res, low 16 bits
    u_v: Floats  # (n, 3) volts at the loads of X, Y, Z (nominal scale)
    temp_code: Ints  # (n,) signed 16-bit code of temp_channel
    temp_channel: Ints  # (n,)
    settled: npt.NDArray[np.bool_]  # (n,)
    clipped: npt.NDArray[np.bool_]  # (n,)

    def __len__(self) -> int:
        return len(self.t_rx_s)

    @staticmethod
    def of(t_rx_s: Floats, t_sample_s: Floats, u_v: Floats, columns: Mapping[str, Ints]) -> Frames:
        """The rest from raw columns by the signals' names, (n,) each, as far as there are such."""
        absent = np.zeros(len(t_rx_s), dtype=np.int64)
        return Frames(
            t_rx_s=t_rx_s,
            t_sample_s=t_sample_s,
            seq=columns.get("SEQ", absent - 1),
            u_v=u_v,
            temp_code=columns.get("T", absent),
            temp_channel=columns.get("CHANNEL", absent),
            settled=columns.get("SETTLED", absent).astype(np.bool_),
            clipped=columns.get("CLIP", absent).astype(np.bool_),
        )

    @property
    def temp_degc(self) -> Floats:
        """Temperature of temp_channel, nominal scale, degC, (n,); NaN where the code is 0, as in a form without it."""
        kelvin = np.where(self.temp_code == 0, np.nan, self.temp_code / TEMP_CODES_PER_K)
        return np.asarray(kelvin + KELVIN_DEGC)

    def head(self, count: int) -> Frames:
        """The first `count` of them."""
        return replace(self, **{f.name: getattr(self, f.name)[:count] for f in fields(self)})

    def axis(self, name: str) -> Floats:
        """Volts of channel "x", "y" or "z", shape (n,)."""
        return self.u_v[:, "xyz".index(name)]


def join_frames(parts: Sequence[Frames]) -> Frames:
    """One `Frames` of many, or none."""
    if len(parts) == 1:
        return parts[0]
    none = np.zeros(0)
    all_of = [Frames.of(none, none, np.zeros((0, 3)), {}), *parts]
    return Frames(**{f.name: np.concatenate([getattr(p, f.name) for p in all_of]) for f in fields(Frames)})


class FrameReader:
    """Collects the frames of one node: `host.listeners.append(reader.on_message, reader.ids)`.

    A gap in the counter is a loss within a stretch of the stream only: `boards.stream` says where one begins.
    """

    def __init__(self, node_id: int = DBC_NODE) -> None:
        self.counters = FrameCounters()
        self._state = NodeState(node_id)
        self._xy: Message | None = None
        self._first: list[bytearray] = []  # pairs: XY; other forms: all of it
        self._second: list[bytearray] = []  # ZT
        self._t_s: list[float] = []  # when the last of each sample arrived
        self._marks: list[int] = []  # places in them where a stretch begins
        self._begun = False  # a half of a pair has been seen
        self._form: Form | None = None
        self._before: int | None = None  # of the stretch's last sample: SEQ, TOG or TSTAMP, by the form
        self._stamp = 0  # unwrapped, of the last sample
        self._steps_s, self._step_s = np.zeros(0), np.nan  # forms without a counter: spacing of frames not judged yet
        self._bytes = {name: int(message(name).length) for name in SAMPLE_MESSAGES}
        ids = {name: int(message(name).frame_id) + node_id - DBC_NODE for name in SAMPLE_MESSAGES}
        self._handlers: dict[int, Callable[[Message], None]] = {
            ids["PSA2_XY"]: self._on_xy,
            ids["PSA2_ZT"]: self._on_zt,
            **{ids[f"PSA2_{form.name}"]: partial(self._on_whole, form) for form in WHOLE},
        }
        self._handlers |= dict.fromkeys(self._state.ids, self._on_state)
        self.ids = frozenset(self._handlers)

    def on_message(self, m: Message) -> None:
        """Take one CAN frame; those of other nodes and services are let by."""
        handler = self._handlers.get(m.arbitration_id)
        if handler is not None and not m.is_error_frame and not m.is_remote_frame:
            handler(m)

    def __len__(self) -> int:
        """Samples that `take` would return; fewer where it finds halves of two samples taken for one."""
        return len(self._first) * (5 if self._form is Form.BLOCK else 1)

    def least(self, count: int) -> int:
        """CAN frames that must come yet before `len` can be count; 1 until the first sample tells the form."""
        if not self._first:
            return 1
        missing_yet = count - len(self)
        if self._form is Form.PAIR:
            return 2 * missing_yet - (self._xy is not None)
        return -(-missing_yet // 5) if self._form is Form.BLOCK else missing_yet

    def forget(self) -> None:
        """Drop what has arrived and is not taken; the next sample begins a stretch."""
        self._drop()
        self._begun = False

    def forget_half(self) -> None:
        """What has come of a pair is no fault if the rest does not come."""
        self._xy = None

    def take(self) -> Frames:
        """Everything since the last call, decoded."""
        first, second, t_s, marks = self._first, self._second, self._t_s, self._marks
        self._first, self._second, self._t_s, self._marks = [], [], [], []
        parts = []
        for begins, span in by_stretch(len(first), marks):
            if begins:
                self._begin()
            if span.start < span.stop:
                self.counters.stretches += self._before is None
                parts.append(self._decode(first[span], second[span], np.array(t_s[span])))
        taken = join_frames(parts)
        self.counters.frames += len(taken)
        return taken

    def _decode(self, first: list[bytearray], second: list[bytearray], t_rx_s: Floats) -> Frames:
        """Of one stretch."""
        assert self._form is not None
        if self._form is Form.PAIR:
            return self._pairs(first, second, t_rx_s)
        return {Form.FAST: self._fast, Form.FRAME: self._fd, Form.BLOCK: self._blocks}[self._form](first, t_rx_s)

    def _drop(self) -> None:
        self._first, self._second, self._t_s, self._xy, self._marks = [], [], [], None, []
        self._stamp = 0
        self._begin()

    def _begin(self) -> None:
        """The next sample is the first of a stretch, in which frames may come at another rate."""
        self._before = None
        self._steps_s, self._step_s = np.zeros(0), np.nan

    def _on_state(self, m: Message) -> None:
        if self._state.begins(m):
            self.forget_half()
            self._marks.append(len(self._first))

    def _on_xy(self, m: Message) -> None:
        self._begun = True
        if self._xy is not None:
            self.counters.torn += 1
        self._xy = m if self._whole("PSA2_XY", m) else None

    def _on_zt(self, m: Message) -> None:
        xy, self._xy = self._xy, None
        begun, self._begun = self._begun, True
        if xy is None and not begun:
            return  # the pair was under way when the reading began
        if xy is None or not self._whole("PSA2_ZT", m):
            self.counters.torn += 1
            return
        self._change(Form.PAIR)
        self._first.append(xy.data)
        self._second.append(m.data)
        self._t_s.append(m.timestamp)

    def _on_whole(self, form: Form, m: Message) -> None:
        if not self._whole(f"PSA2_{form.name}", m):
            return
        self._change(form)
        self._first.append(m.data)
        self._t_s.append(m.timestamp)

    def _whole(self, name: str, m: Message) -> bool:
        right = len(m.data) == self._bytes[name]
        self.counters.torn += not right
        return right

    def _change(self, form: Form) -> None:
        if form is not self._form:
            self._drop()
            self._form = form

    def _count_gaps(self, counter: Ints, bits: int) -> None:
        """Adds the gaps of a wrapping counter that should rise by one."""
        self.counters.lost += missing_counts(counter, bits, self._before)
        self._before = int(counter[-1])

    def _times(self, stamp: Ints, bits: int, unit_s: float) -> Floats:
        """Unwrapped time stamps, continued from the last call; across stretches whole wraps may be missing."""
        unwrapped = signals.unwrap(stamp, bits, self._stamp)
        self._stamp = int(unwrapped[-1])
        return unwrapped.astype(np.float64) * unit_s

    def _samples(self, name: str, t_rx_s: Floats, t_sample_s: Floats, columns: Mapping[str, Ints]) -> Frames:
        """Of raw columns by the signals' names, (n,) each; `name` has the scale of X, Y, Z (all have the same)."""
        self.counters.overruns += int(columns["OVERRUN"].sum()) if "OVERRUN" in columns else 0
        scale = next(s.scale for s in _layout(name).values() if s.unit == "V")
        return Frames.of(t_rx_s, t_sample_s, np.stack([columns[axis] * scale for axis in "XYZ"], axis=1), columns)

    def _pairs(self, xy: list[bytearray], zt: list[bytearray], t_rx_s: Floats) -> Frames:
        columns = _columns("PSA2_XY", xy) | _columns("PSA2_ZT", zt)
        seq, stamp = _layout("PSA2_XY")["SEQ"], _layout("PSA2_ZT")["TSTAMP"]
        mixed = _mixed(columns["SEQ"], columns["TSTAMP"], self._before, self._stamp)
        self.counters.torn += int(mixed.sum())
        columns = {name: column[~mixed] for name, column in columns.items()}
        self._count_gaps(columns["SEQ"], seq.bits)
        t_sample_s = self._times(columns["TSTAMP"], stamp.bits, stamp.scale)
        return self._samples("PSA2_XY", t_rx_s[~mixed], t_sample_s, columns)

    def _fast(self, kept: list[bytearray], t_rx_s: Floats) -> Frames:
        columns = _columns("PSA2_FAST", kept)
        tog = columns["TOG"] if self._before is None else np.concatenate([[self._before], columns["TOG"]])
        self.counters.lost += int((np.diff(tog) == 0).sum())  # two alike in a row
        self._before = int(tog[-1])
        return self._samples("PSA2_FAST", t_rx_s, np.full(len(kept), np.nan), columns)

    def _fd(self, kept: list[bytearray], t_rx_s: Floats) -> Frames:
        columns = _columns("PSA2_FRAME", kept)
        t_sample_s = self._stamped(columns["TSTAMP"], _layout("PSA2_FRAME")["TSTAMP"])
        return self._samples("PSA2_FRAME", t_rx_s, t_sample_s, columns)

    def _blocks(self, kept: list[bytearray], t_rx_s: Floats) -> Frames:
        raw, at = _columns("PSA2_BLOCK", kept), _layout("PSA2_BLOCK")
        count = sum(name.startswith("STATUS") for name in at)
        names = ("X", "Y", "Z", "T", "STATUS")
        columns = {s: np.stack([raw[f"{s}{k}"] for k in range(count)], axis=1).reshape(-1) for s in names}
        status = columns["STATUS"]
        columns |= {name: status >> bit & 1 for bit, name in enumerate(("SETTLED", "CLIP", "OVERRUN"))}
        columns["CHANNEL"] = status >> 4
        t0_s = self._stamped(raw["TSTAMP"], at["TSTAMP"], count)
        period_s = np.median(np.diff(t0_s)) / count if len(t0_s) > 1 else np.nan
        t_sample_s = (t0_s[:, None] + np.arange(count) * period_s).reshape(-1)
        return self._samples("PSA2_BLOCK", np.repeat(t_rx_s, count), t_sample_s, columns)

    def _stamped(self, stamp: Ints, s: signals.Signal, each: int = 1) -> Floats:
        """Times of a form that has no sequence number; its gaps are counted in periods of the stream itself."""
        before_s = [] if self._before is None else [self._before * s.scale]
        t_s = self._times(stamp, s.bits, s.scale)
        self._before = self._stamp
        self._steps_s = np.concatenate([self._steps_s, np.diff(np.concatenate([before_s, t_s]))])
        if self._steps_s.size > 2:
            self._step_s = float(np.median(self._steps_s))
        if np.isfinite(self._step_s):
            periods = np.rint(self._steps_s / self._step_s)
            self.counters.lost += int((periods - 1).clip(min=0).sum()) * each
            self._steps_s = np.zeros(0)
        return t_s


def _mixed(seq: Ints, stamp: Ints, seq_before: int | None, stamp_before: int) -> npt.NDArray[np.bool_]:
    """Which pairs are the first half of one sample and the second half of a later one.

    Where both halves between them were lost, TSTAMP alone tells: the pair's instant is whole periods from where its SEQ
    has it, the next pair's is right again, and SEQ has a gap after it. A last pair has no next one and is believed.
    seq_before, stamp_before: of the sample before, if there is one.
    """
    before = np.array([[seq[0], stamp[0]] if seq_before is None else [seq_before, stamp_before]])
    numbers, ticks = np.diff(np.concatenate([before, np.stack([seq, stamp], axis=1)]), axis=0).T % (1 << 16)
    single = ticks[numbers == 1]
    mixed = np.zeros(len(seq), dtype=np.bool_)
    if single.size < 3 or not (period := np.mean(single[np.abs(single - np.median(single)) <= 2])):
        return mixed  # no one knows the period
    off = (ticks - numbers * period + (1 << 15)) % (1 << 16) - (1 << 15)
    mixed[:-1] = (np.abs(off[:-1]) > period / 2) & (np.abs(off[:-1] + off[1:]) < period / 2) & (numbers[1:] > 1)
    return mixed


def _columns(name: str, data: list[bytearray]) -> dict[str, Ints]:
    """Raw integers (n,) of each signal of frames that all are this message."""
    bits = signals.payload(data, int(message(name).length))
    return {signal: signals.raw(bits, at) for signal, at in _layout(name).items()}


@cache
def _layout(name: str) -> dict[str, signals.Signal]:
    return dict(signals.layout(message(name)))
