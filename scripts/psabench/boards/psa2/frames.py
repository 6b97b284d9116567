"""PSA-2 frames from CAN: pairs, fast form, FD frames and FD blocks, as arrays in SI.

Raw integers end here. `FrameReader` listens to a `CanHost`, keeps the bytes of its node's frames and counts what is
wrong with them; `take` turns what has arrived into one `Frames`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from functools import cache

import numpy as np
import numpy.typing as npt

from psabench.boards.registry import DBC_NODE
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


@dataclass(slots=True, kw_only=True)
class FrameCounters:
    """What was wrong with the stream since it was opened."""

    frames: int = 0
    lost: int = 0  # gaps in the sequence (or, in the fast form, toggles that did not toggle)
    torn: int = 0  # half a pair, or a frame of the wrong length; the gap that it leaves in the sequence is `lost`, too
    overruns: int = 0  # the board says that it lost a conversion


@dataclass(slots=True)
class _Kept:
    """Bytes of one kind of CAN frame, with their times of arrival."""

    data: list[bytes] = field(default_factory=list)
    t_s: list[float] = field(default_factory=list)

    def add(self, m: Message) -> None:
        self.data.append(bytes(m.data))
        self.t_s.append(m.timestamp)


class FrameReader:
    """Collects the frames of one node; append `reader.on_message` to the listeners of a CanHost."""

    def __init__(self, node_id: int = DBC_NODE) -> None:
        self.counters = FrameCounters()
        self._shift = node_id - DBC_NODE
        self._xy: Message | None = None
        self._first, self._second = _Kept(), _Kept()  # pairs: XY and ZT; other forms use _first alone
        self._begun = False  # a half of a pair has been seen
        self._form: Form | None = None
        self._seq: int | None = None
        self._stamp: int | None = None
        self._handlers: dict[int, Callable[[Message], None]] = {
            self._id("PSA2_XY"): self._on_xy,
            self._id("PSA2_ZT"): self._on_zt,
            self._id("PSA2_FAST"): lambda m: self._on_whole(Form.FAST, m),
            self._id("PSA2_FRAME"): lambda m: self._on_whole(Form.FRAME, m),
            self._id("PSA2_BLOCK"): lambda m: self._on_whole(Form.BLOCK, m),
        }

    def _id(self, name: str) -> int:
        return int(message(name).frame_id) + self._shift

    def on_message(self, m: Message) -> None:
        """Take one CAN frame; those of other nodes and services are let by."""
        handler = self._handlers.get(m.arbitration_id)
        if handler is not None and not m.is_error_frame and not m.is_remote_frame:
            handler(m)

    def __len__(self) -> int:
        """Samples that `take` would return; fewer where it finds halves of two samples taken for one."""
        return len(self._first.data) * (5 if self._form is Form.BLOCK else 1)

    def least(self, count: int) -> int:
        """CAN frames that must come yet before `len` can be count; 1 until the first sample tells the form."""
        if not self._first.data:
            return 1
        missing = count - len(self)
        if self._form is Form.PAIR:
            return 2 * missing - (self._xy is not None)
        return -(-missing // 5) if self._form is Form.BLOCK else missing

    def forget(self) -> None:
        """Drop what has arrived and is not taken; the sequence starts again."""
        self._first, self._second, self._xy, self._seq, self._stamp = _Kept(), _Kept(), None, None, None

    def forget_half(self) -> None:
        """A stop may come between the two halves of a pair: that is no fault."""
        self._xy = None

    def take(self) -> Frames:
        """Everything since the last call, decoded."""
        first, second, form = self._first, self._second, self._form
        self._first, self._second = _Kept(), _Kept()
        if not first.data or form is None:
            none = np.zeros(0)
            return self._samples("PSA2_XY", none, none, dict.fromkeys("XYZ", none.astype(np.int64)))
        frames = {Form.PAIR: self._pairs, Form.FAST: self._fast, Form.FRAME: self._fd, Form.BLOCK: self._blocks}
        taken = frames[form](first, second)
        self.counters.frames += len(taken)
        return taken

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
        self._first.add(xy)
        self._second.add(m)

    def _on_whole(self, form: Form, m: Message) -> None:
        if not self._whole(f"PSA2_{form.name}", m):
            return
        self._change(form)
        self._first.add(m)

    def _whole(self, name: str, m: Message) -> bool:
        right = bool(len(m.data) == message(name).length)
        self.counters.torn += not right
        return right

    def _change(self, form: Form) -> None:
        if form is not self._form:
            self.forget()
            self._form = form

    def _count_gaps(self, counter: Ints, bits: int) -> None:
        """Adds the gaps of a wrapping counter that should rise by one."""
        before = counter[:1] - 1 if self._seq is None else np.array([self._seq])
        steps = np.diff(np.concatenate([before, counter])) % (1 << bits)
        self.counters.lost += int((steps - 1).clip(min=0).sum()) if bits > 1 else int((steps == 0).sum())
        self._seq = int(counter[-1])

    def _times(self, stamp: Ints, bits: int, unit_s: float) -> Floats:
        """Unwrapped time stamps, continued from the last call."""
        unwrapped = signals.unwrap(stamp, bits, self._stamp or 0)
        self._stamp = int(unwrapped[-1])
        return unwrapped.astype(np.float64) * unit_s

    def _samples(self, name: str, t_rx_s: Floats, t_sample_s: Floats, columns: Mapping[str, Ints]) -> Frames:
        """Of raw columns by the signals' names, (n,) each; `name` has the scale of X, Y, Z (all have the same)."""
        self.counters.overruns += int(columns["OVERRUN"].sum()) if "OVERRUN" in columns else 0
        scale = next(s.scale for s in _layout(name).values() if s.unit == "V")
        return Frames.of(t_rx_s, t_sample_s, np.stack([columns[axis] * scale for axis in "XYZ"], axis=1), columns)

    def _pairs(self, xy: _Kept, zt: _Kept) -> Frames:
        columns = _columns("PSA2_XY", xy.data) | _columns("PSA2_ZT", zt.data)
        seq, stamp = _layout("PSA2_XY")["SEQ"], _layout("PSA2_ZT")["TSTAMP"]
        mixed = _mixed(columns["SEQ"], columns["TSTAMP"], self._seq, self._stamp)
        self.counters.torn += int(mixed.sum())
        columns = {name: column[~mixed] for name, column in columns.items()}
        self._count_gaps(columns["SEQ"], seq.bits)
        t_sample_s = self._times(columns["TSTAMP"], stamp.bits, stamp.scale)
        return self._samples("PSA2_XY", np.array(zt.t_s)[~mixed], t_sample_s, columns)

    def _fast(self, kept: _Kept, _: _Kept) -> Frames:
        columns = _columns("PSA2_FAST", kept.data)
        self._count_gaps(columns["TOG"], 1)
        return self._samples("PSA2_FAST", np.array(kept.t_s), np.full(len(kept.data), np.nan), columns)

    def _fd(self, kept: _Kept, _: _Kept) -> Frames:
        columns = _columns("PSA2_FRAME", kept.data)
        t_sample_s = self._stamped(columns["TSTAMP"], _layout("PSA2_FRAME")["TSTAMP"])
        return self._samples("PSA2_FRAME", np.array(kept.t_s), t_sample_s, columns)

    def _blocks(self, kept: _Kept, _: _Kept) -> Frames:
        raw, at = _columns("PSA2_BLOCK", kept.data), _layout("PSA2_BLOCK")
        count = sum(name.startswith("STATUS") for name in at)
        names = ("X", "Y", "Z", "T", "STATUS")
        columns = {s: np.stack([raw[f"{s}{k}"] for k in range(count)], axis=1).reshape(-1) for s in names}
        status = columns["STATUS"]
        columns |= {name: status >> bit & 1 for bit, name in enumerate(("SETTLED", "CLIP", "OVERRUN"))}
        columns["CHANNEL"] = status >> 4
        t0_s = self._stamped(raw["TSTAMP"], at["TSTAMP"], count)
        period_s = np.median(np.diff(t0_s)) / count if len(t0_s) > 1 else np.nan
        t_sample_s = (t0_s[:, None] + np.arange(count) * period_s).reshape(-1)
        return self._samples("PSA2_BLOCK", np.repeat(np.array(kept.t_s), count), t_sample_s, columns)

    def _stamped(self, stamp: Ints, s: signals.Signal, each: int = 1) -> Floats:
        """Times of a form that has no sequence number; its gaps are counted in periods of the stream itself."""
        before = self._stamp
        t_s = self._times(stamp, s.bits, s.scale)
        steps_s = np.diff(t_s if before is None else np.concatenate([[before * s.scale], t_s]))
        if steps_s.size > 2:
            periods = np.rint(steps_s / np.median(steps_s))
            self.counters.lost += int((periods - 1).clip(min=0).sum()) * each
        return t_s


def _mixed(seq: Ints, stamp: Ints, seq_before: int | None, stamp_before: int | None) -> npt.NDArray[np.bool_]:
    """Which pairs are the first half of one sample and the second half of a later one.

    Where both halves between them were lost, TSTAMP alone tells: the pair's instant is whole periods from where its SEQ
    has it, the next pair's is right again, and SEQ has a gap after it. A last pair has no next one and is believed.
    """
    known = seq_before is not None and stamp_before is not None
    before = np.array([[seq_before or 0, stamp_before or 0]] if known else [[seq[0], stamp[0]]])
    numbers, ticks = np.diff(np.concatenate([before, np.stack([seq, stamp], axis=1)]), axis=0).T % (1 << 16)
    single = ticks[numbers == 1]
    mixed = np.zeros(len(seq), dtype=np.bool_)
    if single.size < 3 or not (period := np.mean(single[np.abs(single - np.median(single)) <= 2])):
        return mixed  # no one knows the period
    off = (ticks - numbers * period + (1 << 15)) % (1 << 16) - (1 << 15)
    mixed[:-1] = (np.abs(off[:-1]) > period / 2) & (np.abs(off[:-1] + off[1:]) < period / 2) & (numbers[1:] > 1)
    return mixed


def _columns(name: str, data: list[bytes]) -> dict[str, Ints]:
    """Raw integers (n,) of each signal of frames that all are this message."""
    bits = signals.payload(data, int(message(name).length))
    return {signal: signals.raw(bits, at) for signal, at in _layout(name).items()}


@cache
def _layout(name: str) -> dict[str, signals.Signal]:
    return dict(signals.layout(message(name)))
