"""A host that is written down: what it would send over CAN, each frame at its instant, and a bench that carries it out.

In free pace time does not wait for a program. So the host's frames are in the scenario's timeline (`can.put`), the
emulator runs alone from power-on as fast as it goes, and the bus is recorded. What the units answered is in the
recording, and nothing else is: no truth, no control socket.

    bench = ScriptedBench(scenario)
    bench.write(9, 0x2100, 1, 4)      # at bench.now_s, which moves on
    bench.wait(60.0)
    bench.recording(bench.now_s)      # of all of it
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import canopen

from psabench.errors import BadInput, BenchError, DeviceError, LinkError
from psabench.link import can_log
from psabench.link.can_log import Logged
from psabench.places import find_emulator, proto_file

READY_S = 1.0  # after power-on: gyroscopes have run up and converters are set up
TURN_S = 0.005  # a request and its answer, on a busy bus
SDO_REQUEST, SDO_ANSWER = 0x600, 0x580
DOWNLOAD, UPLOAD, UPLOADED, ABORT = 0x20, 0x40, 0x43, 0x80
SETTLED_S = 0.05  # recorded beyond the last thing that was asked for
EMULATOR_S = 120.0  # timeout for a process that takes a twentieth of a second

Key = tuple[int, int, int]  # node, index, sub-index
Plates = dict[Key, bytes]  # what units answered to reads before a run: the same for all runs with the same units
Scenario = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _Request:
    """An SDO transfer of the script."""

    key: Key
    frame: bytes
    what: str


class ScriptedBench:
    """A scenario, the host's part in it so far, and the recording of what came."""

    def __init__(
        self, scenario: Scenario, *, listen_to: frozenset[int], bus: str, plates: Plates | None = None
    ) -> None:
        """listen_to: identifiers that a recording keeps, answers to SDO besides. bus: its name in the scenario."""
        self.now_s = READY_S
        self.emulator_s = 0.0  # processor time of the emulators so far
        self._scenario = dict(scenario)
        self._listen_to, self._bus = listen_to, bus
        self._plates = {} if plates is None else plates
        self._frames: list[tuple[float, str]] = []
        self._requests: list[_Request] = []
        self._written: dict[Key, bytes] = {}
        self._recording: Logged | None = None
        self._recorded_s = 0.0  # it is good up to here

    # ---- what the host sends

    def nmt(self, node: int, command: int) -> None:
        """A service of network management to a node."""
        self._send(0, bytes([command, node]))

    def write(self, board: str, key: Key, value: float) -> None:
        """An object; whether the unit took it, the recording tells."""
        data = _variable(board, key).encode_raw(value)
        specifier = DOWNLOAD | 0x03 | (4 - len(data)) << 2
        self._written[key] = data
        self._transfer(key, bytes([specifier]), data, f"write {key[1]:04X}h:{key[2]} = {value:g}")

    def read(self, board: str, key: Key) -> Any:
        """An object as the units have it now: as it was written, or as they answer."""
        if key not in self._written:
            self._transfer(key, bytes([UPLOAD]), b"", f"read {key[1]:04X}h:{key[2]}")
            if key not in self._plates:
                self._record(self.now_s)
        return _variable(board, key).decode_raw(self._written.get(key) or self._plates[key])

    def wait(self, dwell_s: float) -> None:
        """The next thing happens so much later."""
        self.now_s += dwell_s

    def _transfer(self, key: Key, specifier: bytes, data: bytes, what: str) -> None:
        node, index, sub = key
        frame = (specifier + index.to_bytes(2, "little") + bytes([sub]) + data).ljust(8, b"\0")
        self._requests.append(_Request(key, frame, f"node {node}: {what}"))
        self._send(SDO_REQUEST + node, frame)

    def _send(self, can_id: int, data: bytes) -> None:
        self._frames.append((self.now_s, f"{can_id:03X}#{data.hex().upper()}"))
        self._recorded_s = min(self._recorded_s, self.now_s)  # what came before does not change by it
        self.now_s = round(self.now_s + TURN_S, 9)

    # ---- what came

    def recording(self, until_s: float) -> Logged:
        """All that came until then, and perhaps more. Raises DeviceError where a unit rejected something."""
        if self._recording is None or self._recorded_s < until_s:
            self._record(until_s)
        assert self._recording is not None
        return self._recording

    def _record(self, until_s: float) -> None:
        """Run it from power-on, long enough for the last answer."""
        text, used_s = run({**self._scenario, "timeline": self._timeline()}, until_s + SETTLED_S, self._bus)
        self.emulator_s += used_s
        nodes = {r.key[0] for r in self._requests}
        r = can_log.read(text, self._listen_to | {SDO_ANSWER + n for n in nodes})
        self._heed(r)
        self._recording, self._recorded_s = r, until_s

    def _timeline(self) -> list[dict[str, Any]]:
        own = self._scenario.get("timeline") or []
        sent = [(t_s, {"frame": frame, "bus": self._bus}) for t_s, frame in self._frames]
        return [*own, *({"at_s": t_s, "cmd": "can.put", "args": args} for t_s, args in sent)]

    def _heed(self, r: Logged) -> None:
        """Each request has its answer: in the order of asking, a node's own."""
        answers: dict[int, Iterator[bytes]] = {}
        for request in self._requests:
            node = request.key[0]
            if node not in answers:
                answers[node] = (int(x).to_bytes(8, "little") for x in r.only([SDO_ANSWER + node]).data)
            answer = next(answers[node], b"")
            if answer[1:4] != request.frame[1:4]:
                raise LinkError(f"{request.what}: no answer; is the unit powered and on this bus?")
            if answer[0] == ABORT:
                code = int.from_bytes(answer[4:8], "little")
                raise DeviceError(request.what, code, canopen.SdoAbortedError(code).CODES.get(code, "refused"))
            if answer[0] & 0xF3 == UPLOADED:
                self._keep(request, answer[4 : 8 - (answer[0] >> 2 & 3)])

    def _keep(self, request: _Request, data: bytes) -> None:
        if self._plates.setdefault(request.key, data) != data:
            raise LinkError(f"{request.what}: the value differs from that of earlier runs")


@cache
def _dictionary(board: str) -> Any:
    return canopen.import_od(str(proto_file(f"{board}.eds")), 1)


def _variable(board: str, key: Key) -> Any:
    found = _dictionary(board).get_variable(key[1], key[2])
    if found is None:
        raise DeviceError(f"node {key[0]}: {key[1]:04X}h:{key[2]}", 0x06020000, "no such object in the EDS")
    return found


# ---- the emulator


def run(scenario: Scenario, for_s: float, bus: str) -> tuple[bytes, float]:
    """The log of a bus of a scenario from power-on, and the processor time that the emulator took.

    Nothing is left behind, whatever ends it: scenario and log are files without a name, and the process ends by itself.
    Raises BadInput for a scenario that is rejected, BenchError where the machine rejected something.
    """
    with _nameless("scenario") as given, _nameless("log") as log:
        os.write(given, json.dumps(scenario).encode())  # YAML 1.2, too
        argv = [str(find_emulator()), f"/dev/fd/{given}", "--pace", "free", "--for", f"{for_s:.9f}s", "--quiet"]
        argv += ["--can", f"{bus}=log:/dev/fd/{log}"]
        used_s = _processor_s()
        try:
            done = subprocess.run(
                argv,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                pass_fds=(given, log),
                start_new_session=True,  # Ctrl-C is for us; we end it
                timeout=EMULATOR_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise BenchError(f"the emulator still runs after {EMULATOR_S:g} s") from None
        words = done.stderr.decode(errors="replace").strip()
        if done.returncode:
            raise (BadInput if done.returncode == BadInput.exit_status else BenchError)(words or "the emulator failed")
        if words:  # a command of the timeline that was rejected, a frame form that the bus cannot carry
            raise LinkError(words)
        return _contents(log), _processor_s() - used_s


@contextmanager
def _nameless(name: str) -> Iterator[int]:
    """A file in memory."""
    fd = os.memfd_create(f"psabench-{name}")
    try:
        yield fd
    finally:
        os.close(fd)


def _contents(fd: int) -> bytes:
    size = os.fstat(fd).st_size
    text = os.pread(fd, size, 0)
    while len(text) < size:
        text += os.pread(fd, size - len(text), len(text))
    return text


def _processor_s() -> float:
    """Of children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
