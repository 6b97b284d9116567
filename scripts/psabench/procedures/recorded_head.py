"""A run of a calibration as a recording, and procedures on it: the CAN log, and what was asked of the instruments.

The log is of any format that psabench reads. A recording has no reaction: the calls of the procedure (head, readings)
lie beside it in FILE.calls.csv, each with its argument, the answer, the bench's time and the number of frames received
by then. On replay the procedure makes the same calls and is refused at the first other one. Readings are decoded again
from the frames of the log, by number, so that what a format does to time stamps does not matter.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import can
import numpy as np
import numpy.typing as npt

from psabench.boards.objects import Psa2Objects
from psabench.boards.psa2.device import raw_word_v
from psabench.boards.psa2.frames import FrameReader
from psabench.conform.capture.log import CanFrame
from psabench.conform.sources.can_logs import read_can
from psabench.conform.sources.taken import Bounds
from psabench.errors import BadInput, expected, input_error
from psabench.estimate.face import Face
from psabench.link.can_host import CanHost
from psabench.logs.call_log import SETUP, Calls, CallWriter, check_ending
from psabench.procedures.head_bench import HeadBench
from psabench.report.provenance import noted_scenarios

LONGEST_S = 1e9  # of a recording
SDO_ANSWER = 0x580
UPLOADED_4 = 0x43  # first byte of an answer that holds four bytes


class HeadRecorder(AbstractContextManager["HeadRecorder"]):
    """A HeadBench that passes every call on and stores it; the frames of `host` go to the log meanwhile."""

    def __init__(self, bench: HeadBench, host: CanHost, path: Path, setup: Mapping[str, Any]) -> None:
        """Raises BadInput or OutputError when one of the two files cannot be made."""
        self.g_mps2 = bench.g_mps2
        self._bench, self._host = bench, host
        self._calls = CallWriter(path)
        host.listeners.append(self._calls.keep_frame)
        self._store(SETUP, json.dumps({**setup, "scenarios": noted_scenarios()}), "")

    def _store(self, call: str, argument: str, answer: str) -> None:
        self._calls.store_call(call, argument, answer, self._bench.t_s)

    @property
    def t_s(self) -> float:
        """As of the last call: what the recording knows."""
        return self._calls.t_s

    def turn(self, angle_deg: float) -> float:
        scale_deg = self._bench.turn(angle_deg)
        self._store("turn", repr(float(angle_deg)), repr(float(scale_deg)))
        return scale_deg

    def mount(self, face: Face) -> None:
        self._bench.mount(face)
        self._store("mount", face.value, "")

    def wait(self, dwell_s: float) -> None:
        self._bench.wait(dwell_s)
        self._store("wait", repr(float(dwell_s)), "")

    def read(self, axis: str, readings: int) -> npt.NDArray[np.float64]:
        u_v = self._bench.read(axis, readings)
        self._store("read", f"{axis} {readings}", "")
        return u_v

    def __exit__(self, kind: type[BaseException] | None, *rest: Any) -> None:
        self._host.listeners.remove(self._calls.keep_frame)
        self._calls.__exit__(kind, *rest)


class RecordedHead:
    """A HeadBench whose answers are those of a recording."""

    def __init__(self, path: Path) -> None:
        """Raises BadInput for a log or calls that are missing, cut, damaged or do not belong together."""
        self._calls = Calls(path)
        self.setup = self._read_setup()
        self.g_mps2 = float(self.setup["g_mps2"])
        self._node, self._average = int(self.setup["node"]), int(self.setup["average"])
        self._filter_gain = float(self.setup.get("filter_gain", 1.0))  # recordings of earlier versions: not taken out
        self._frames = _read_frames(path)
        self._calls.check_frames(len(self._frames))

    def _read_setup(self) -> dict[str, Any]:
        setup = self._calls.setup
        try:
            _ = float(setup["g_mps2"]), int(setup["node"]), int(setup["average"])
        except (ValueError, KeyError, TypeError) as e:
            raise self._calls.no_setup() from e
        return setup

    @property
    def t_s(self) -> float:
        return self._calls.t_s

    def turn(self, angle_deg: float) -> float:
        return float(self._calls.next_call("turn", repr(float(angle_deg)))["answer"])

    def mount(self, face: Face) -> None:
        self._calls.next_call("mount", face.value)

    def wait(self, dwell_s: float) -> None:
        self._calls.next_call("wait", repr(float(dwell_s)))

    def read(self, axis: str, readings: int) -> npt.NDArray[np.float64]:
        begin = self._calls.frames
        self._calls.next_call("read", f"{axis} {readings}")
        frames = self._frames[begin : self._calls.frames]
        if self._average:
            return self._streamed(frames, axis, readings) / self._filter_gain
        return self._words(frames, axis, readings) / self._filter_gain

    def _streamed(self, frames: Sequence[CanFrame], axis: str, readings: int) -> npt.NDArray[np.float64]:
        reader = FrameReader(self._node)
        for f in frames:
            reader.on_message(can.Message(timestamp=f.t_s, arbitration_id=f.can_id, data=f.data, is_fd=f.fd))
        count = readings * self._average
        u_v = reader.take().head(count).axis(axis)
        self._check_count(len(u_v), count, "samples")
        return np.asarray(u_v.reshape(readings, self._average).mean(axis=1), dtype=np.float64)

    def _words(self, frames: Sequence[CanFrame], axis: str, readings: int) -> npt.NDArray[np.float64]:
        """From the answers to the reads of the axis' whole word."""
        head = bytes([UPLOADED_4]) + int(Psa2Objects.RAW_WORDS).to_bytes(2, "little") + bytes(["xyz".index(axis) + 1])
        answers = [f.data[4:] for f in frames if f.can_id == SDO_ANSWER + self._node and f.data[:4] == head]
        self._check_count(len(answers), readings, "words")
        return np.array([raw_word_v(int.from_bytes(a, "little", signed=True)) for a in answers])

    def _check_count(self, got: int, wanted: int, what: str) -> None:
        if got != wanted:
            raise BadInput(expected(f"{wanted} {what} in the log for this reading", got, self._calls.where))


def _read_frames(path: Path) -> tuple[CanFrame, ...]:
    """Raises BadInput for a log that cannot be read to its end."""
    check_ending(path)
    try:
        take = read_can(path, Bounds(max_s=LONGEST_S))
    except OSError as e:
        raise input_error(path, "a CAN log", e) from e
    if take.note:
        raise BadInput(f"{path}: {take.note}")
    return tuple(f for f in take.frames if not f.error)
