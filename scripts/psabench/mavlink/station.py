"""A MAVLink system on a thread of its own: heartbeat, parameters, commands, whatever the bench is doing meanwhile.

The thread owns the port. What needs the bench (reading the unit, calibrating) becomes a `Job` that the program's main
thread takes; while that is busy, parameters are answered from what is known. Other threads send with `send`.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from psabench.errors import expected
from psabench.mavlink.dialect import mavlink
from psabench.mavlink.parameters import Parameters
from psabench.mavlink.ports import Parser, Port, PortSpec

AUTOPILOTS = {"generic": 0, "px4": 12, "ardupilot": 3, "invalid": 8}  # MAV_AUTOPILOT
HEARTBEAT_S = 1.0
POLL_S = 0.02
TEXT = 50  # characters of one STATUSTEXT
FTP_NAK, FTP_NOT_FOUND = 129, 10
CALIBRATION = 241  # MAV_CMD_PREFLIGHT_CALIBRATION
ACCEPTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS, CANCELLED = 0, 2, 3, 4, 5, 6  # MAV_RESULT
TEMPORARILY_REJECTED = 1
INFO, WARNING, CRITICAL = 6, 4, 2  # MAV_SEVERITY


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Who the system is."""

    sysid: int = 1
    compid: int = 1
    autopilot: int = AUTOPILOTS["px4"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Requester:
    """Who asked."""

    sysid: int
    compid: int


@dataclass(frozen=True, slots=True)
class ReadJob:
    """Read a parameter where it is, and send it."""

    index: int


@dataclass(frozen=True, slots=True)
class WriteJob:
    index: int
    value: float


@dataclass(frozen=True, slots=True)
class CalibrateJob:
    requester: Requester


Job = ReadJob | WriteJob | CalibrateJob


class Station:
    """One system. `start` begins to send, `close` ends the thread and the port."""

    def __init__(self, spec: PortSpec, identity: Identity, parameters: Parameters, time_us: Callable[[], int]) -> None:
        """time_us: time of the bench, for answers that carry it. Raises BadInput for a port that is in use."""
        self.identity = identity
        self.parameters = parameters
        self.jobs: queue.Queue[Job] = queue.Queue(maxsize=1024)
        self.can_calibrate = True
        self.messages_sent = self.malformed = self.received = 0
        self._time_us = time_us
        self._lock = threading.Lock()
        self._mav = mavlink().MAVLink(None, srcSystem=identity.sysid, srcComponent=identity.compid)
        self._text_id = 0
        self._calibrating: Requester | None = None
        self._progress = 0
        self._cancelled = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="mavlink", daemon=True)
        self.on_interval: Callable[[int, float], bool] = lambda _id, _us: False  # SET_MESSAGE_INTERVAL
        self.on_request: Callable[[int], bool] = lambda _id: False  # REQUEST_MESSAGE of what the bridge sends
        self.failure: BaseException | None = None
        self.port = Port(spec, self._new_parser)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self.port.close()

    # ---- sending, from any thread

    def send(self, message: Any) -> None:
        with self._lock:
            self.port.send(message.pack(self._mav))
            self._mav.seq = (self._mav.seq + 1) % 256
            self.messages_sent += 1

    def send_heartbeat(self) -> None:
        state = 3 if self._calibrating is None else 2  # MAV_STATE: standby, calibrating
        self.send(mavlink().MAVLink_heartbeat_message(0, self.identity.autopilot, 0, 0, state, 3))

    def text(self, severity: int, text: str) -> None:
        """STATUSTEXT, in chunks where it is longer than one holds."""
        raw = text.encode("ascii", "replace")
        chunks = [raw[at : at + TEXT] for at in range(0, len(raw), TEXT)] or [b""]
        if len(chunks) > 1:
            self._text_id = self._text_id % 65535 + 1
        for k, chunk in enumerate(chunks):
            self.send(mavlink().MAVLink_statustext_message(severity, chunk, self._text_id if len(chunks) > 1 else 0, k))

    def send_parameter(self, index: int) -> None:
        p = self.parameters[index]
        self.send(mavlink().MAVLink_param_value_message(p.name.encode(), p.wire(), p.kind, len(self.parameters), index))

    def acknowledge(self, to: Requester, result: int, command: int = CALIBRATION, progress: int = 0) -> None:
        self.send(mavlink().MAVLink_command_ack_message(command, result, progress, 0, to.sysid, to.compid))

    # ---- the calibration under way, from the main thread

    def cancelled(self) -> bool:
        """Whether a ground station asked to end it."""
        return self._cancelled.is_set()

    def calibration_progress(self, percent: int) -> None:
        """In COMMAND_ACK, and in the text that PX4's clients read."""
        if self._calibrating is not None and percent != self._progress:
            self._progress = percent
            self.acknowledge(self._calibrating, IN_PROGRESS, progress=percent)
            self.text(INFO, f"[cal] progress <{percent}>")

    def calibration_over(self, result: int, text: str) -> None:
        """The last words of it: the text comes first, as PX4 has it."""
        to, self._calibrating = self._calibrating, None
        self.text(INFO if result == 0 else CRITICAL, f"[cal] calibration {text}")
        if to is not None:
            self.acknowledge(to, result)

    # ---- the thread

    def _new_parser(self) -> Parser:
        parser = mavlink().MAVLink(None)
        parser.robust_parsing = True

        def parse(data: bytes) -> list[Any]:
            messages = parser.parse_buffer(data) or []
            good = [m for m in messages if m.get_type() != "BAD_DATA"]
            self.malformed += len(messages) - len(good)
            return good

        return parse

    def _run(self) -> None:
        try:
            beat_s = 0.0
            while not self._stop.is_set():
                now_s = time.monotonic()
                if now_s >= beat_s:
                    self.send_heartbeat()
                    beat_s = max(beat_s + HEARTBEAT_S, now_s)
                for m in self._poll():
                    self.received += 1
                    self.take(m)
        except BaseException as e:  # the main thread raises it
            self.failure = e

    def _poll(self) -> list[Any]:
        return self.port.poll(POLL_S)

    def take(self, m: Any) -> None:
        """One message of a peer."""
        handlers: Mapping[str, Callable[[Any], None]] = {
            "PARAM_REQUEST_LIST": self._take_list,
            "PARAM_REQUEST_READ": self._take_read,
            "PARAM_SET": self._take_set,
            "COMMAND_LONG": self._take_command,
            "COMMAND_INT": self._take_command,
            "FILE_TRANSFER_PROTOCOL": self._refuse_file,
            "PING": self._answer_ping,
            "TIMESYNC": self._answer_timesync,
        }
        handler = handlers.get(m.get_type())
        if handler is not None and self._is_for_us(m):
            handler(m)

    def _is_for_us(self, m: Any) -> bool:
        system, component = getattr(m, "target_system", 0), getattr(m, "target_component", 0)
        return m.get_type() == "PING" or (system in (0, self.identity.sysid) and component in (0, self.identity.compid))

    # ---- parameters

    def _busy(self) -> bool:
        return self._calibrating is not None

    def _put(self, job: Job) -> bool:
        try:
            self.jobs.put_nowait(job)
        except queue.Full:
            return False  # the client asks again
        return True

    def _ask(self, index: int) -> None:
        """Fresh where it can be had, else as it is known."""
        if self.parameters[index].read is None or self._busy():
            self.send_parameter(index)
        else:
            self._put(ReadJob(index))

    def _take_list(self, _: Any) -> None:
        for index in range(len(self.parameters)):
            self._ask(index)

    def _take_read(self, m: Any) -> None:
        index = self.parameters.find(m.param_id, m.param_index)
        if index is None:
            self.text(WARNING, f"{_printable_text(m.param_id)}: expected a parameter of this system")
        else:
            self._ask(index)

    def _take_set(self, m: Any) -> None:
        index = self.parameters.find(m.param_id)
        if index is None:
            self.text(WARNING, f"{_printable_text(m.param_id)}: expected a parameter of this system")
            return
        p = self.parameters[index]
        try:
            value = p.check(m.param_type, m.param_value)
            if self._busy():
                raise ValueError(expected("no calibration under way", "one"))
        except ValueError as e:
            self.text(WARNING, f"{p.name}: {e}")
            self._ask(index)  # the value that it keeps
            return
        self._put(WriteJob(index, value))

    # ---- commands

    def _take_command(self, m: Any) -> None:
        to = Requester(sysid=m.get_srcSystem(), compid=m.get_srcComponent())
        if m.get_type() == "COMMAND_INT":
            p = [m.param1, m.param2, m.param3, m.param4, float(m.x), float(m.y), m.z]
        else:
            p = [m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7]
        if m.command == CALIBRATION:  # clients leave what they do not use at NaN
            p = [0.0 if math.isnan(x) else x for x in p]
            self._take_calibration(to, p, getattr(m, "confirmation", 0))
            return
        commands: Mapping[int, Callable[[list[float]], int]] = {
            512: lambda p: ACCEPTED if self._send_requested(int(p[0])) else UNSUPPORTED,  # REQUEST_MESSAGE
            511: lambda p: ACCEPTED if self.on_interval(int(p[0]), p[1]) else DENIED,  # SET_MESSAGE_INTERVAL
            520: lambda _: ACCEPTED if self._send_requested(148) else FAILED,  # REQUEST_AUTOPILOT_CAPABILITIES
        }
        try:
            result = commands[m.command](p) if m.command in commands else UNSUPPORTED
        except (ValueError, OverflowError):  # NaN or infinity for a number
            result = DENIED
        self.acknowledge(to, result, m.command)

    def _send_requested(self, number: int) -> bool:
        if number == 0:
            self.send_heartbeat()
        elif number == 148:  # AUTOPILOT_VERSION: MAVLink 2, parameters bytewise, COMMAND_INT
            self.send(
                mavlink().MAVLink_autopilot_version_message(
                    8192 | 16 | 8, 0, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0
                )
            )
        else:
            return self.on_request(number)
        return True

    def _take_calibration(self, to: Requester, p: list[float], confirmation: int) -> None:
        if not any(p):
            self._cancel(to)
        elif self._calibrating is not None:
            again = confirmation > 0 and to == self._calibrating  # it did not get our first answer
            self.acknowledge(
                to, IN_PROGRESS if again else TEMPORARILY_REJECTED, progress=self._progress if again else 0
            )
        elif p[4] != 1 or any(p[:4]) or any(p[5:]):
            self.text(WARNING, "calibration: only the accelerometer (param5 = 1)")
            self.acknowledge(to, UNSUPPORTED)
        elif not self.can_calibrate:
            self.text(WARNING, "calibration: expected a bench with a dividing head, got a log or none")
            self.acknowledge(to, DENIED)
        elif self._put(CalibrateJob(to)):
            self._cancelled.clear()
            self._calibrating, self._progress = to, 0
            self.acknowledge(to, IN_PROGRESS)
            self.text(INFO, "[cal] calibration started: 2 accel")
        else:
            self.acknowledge(to, TEMPORARILY_REJECTED)

    def _cancel(self, to: Requester) -> None:
        if self._calibrating is None:
            self.acknowledge(to, ACCEPTED)  # there is nothing to end
        self._cancelled.set()  # the procedure's end is acknowledged when it comes

    # ---- what is answered at once

    def _refuse_file(self, m: Any) -> None:
        """There are no files: a client that wants its parameters as one goes on to the parameter protocol."""
        request = bytes(m.payload)
        if request[3] >= FTP_NAK - 1:
            return
        answer = bytearray(request[:12])
        answer[0:2] = ((int.from_bytes(request[0:2], "little") + 1) & 0xFFFF).to_bytes(2, "little")
        answer[3], answer[4], answer[5] = FTP_NAK, 1, request[3]
        answer += bytes([FTP_NOT_FOUND])
        answer += bytes(251 - len(answer))
        self.send(
            mavlink().MAVLink_file_transfer_protocol_message(0, m.get_srcSystem(), m.get_srcComponent(), list(answer))
        )

    def _answer_ping(self, m: Any) -> None:
        if m.target_system == 0 and m.target_component == 0:
            self.send(mavlink().MAVLink_ping_message(m.time_usec, m.seq, m.get_srcSystem(), m.get_srcComponent()))

    def _answer_timesync(self, m: Any) -> None:
        if m.tc1 == 0:
            self.send(mavlink().MAVLink_timesync_message(self._time_us() * 1000, m.ts1))


def _printable_text(text: str) -> str:
    return "".join(c if " " <= c <= "~" else "?" for c in text)
