"""The host's end of the CAN bus. The only file that imports python-can.

One thread: frames are received where the caller waits (`advance`, `pump_until`), so that a procedure in step time is a
pure function of its inputs. Time is the bench's: with a control socket in step pace it moves only when we say so, and a
wait ends when every frame of that time has arrived (barrier: the emulator says how many it has sent); otherwise it is
the wall clock's and a wait is spent receiving.
"""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from itertools import islice
from operator import length_hint
from typing import Any, Protocol

import can
from can.interfaces.slcan import slcanBus
from can.interfaces.socketcan import SocketcanBus

from psabench.errors import BadInput, LinkError, TimeOut, expected, link_error
from psabench.link.cannelloni_bus import CannelloniBus
from psabench.link.control import Control, Reply
from psabench.link.listeners import Listeners
from psabench.link.socketcand_bus import SocketcandBus
from psabench.link.udp_bus import LocalUdpBus, group_of

BARRIER_S = 10.0  # timeout for a frame that the emulator says it has sent
GREETING_S = 10.0  # timeout for the first words of a socketcand server
LOOK_S = 0.2  # real time between looks whether a silent link is still there
OTHERS_S = 0.005  # real time between looks at the other buses
TURN = 256  # frames from a bus before the next one has its turn
QUANTUM_S = 0.001  # step of simulated time while waiting for an answer
BULK_QUANTA = 1000  # at most in one command, so that Ctrl-C is heard
NS = 1_000_000_000
SO_RCVBUFFORCE, RCVBUF = 33, 4 << 20  # asm-generic/socket.h; bytes

NMT = 0x000  # identifier of the commands of network management (CiA 301, 7.2.8)

Message = can.Message


def _do_nothing() -> None:
    """Between two slices of a wait, where no program wants to look."""


class Clock(Protocol):
    """Whose time it is. between: called after each slice of a wait; what it raises ends the wait."""

    between: Callable[[], None]

    def now_s(self) -> float:
        """Bench time, s."""
        ...

    def advance(self, host: CanHost, dwell_s: float) -> None:
        """Let dwell_s pass, receiving meanwhile."""
        ...


class WallClock:
    """Real time: a real bench, or an emulator in wall pace. others: hosts of further buses, received from as well."""

    def __init__(self, others: Sequence[CanHost] = ()) -> None:
        self._others = others
        self.between: Callable[[], None] = _do_nothing

    def now_s(self) -> float:
        return time.monotonic()

    def advance(self, host: CanHost, dwell_s: float) -> None:
        deadline = time.monotonic() + dwell_s
        while (left := deadline - time.monotonic()) > 0.0:
            host.receive_turn(min(left, OTHERS_S if self._others else LOOK_S))
            for other in self._others:
                if other is not host:
                    other.receive_turn(0.0)
            self.between()


class StepClock:
    """Simulated time of an emulator in step pace, moved through its control socket.

    hosts: all that this program has on the buses, in the order of their opening and the last to have come. Without
    them it is the clock of one host, which has been on the bus longest.
    """

    def __init__(self, control: Control, hosts: Sequence[CanHost] = ()) -> None:
        self._control = control
        self._hosts = list(hosts)
        first = _frames_of_all(control, self._hosts)
        self._t_ns, self._base_tx = first.t_ns, _frames_taken(first)
        self._mine = sorted(first.rx)[-len(self._hosts) :] if self._hosts else []  # they came last
        self._base_rx = self._delivered(first)  # frames sent before these hosts were there
        self.in_bulk = bool(self._hosts) and all(h.counted for h in self._hosts)
        self.deadline_s = math.inf  # no time passes after it
        self.between: Callable[[], None] = _do_nothing

    def now_s(self) -> float:
        return self._t_ns * 1e-9

    def advance(self, host: CanHost, dwell_s: float) -> None:
        self.command(host, "run", for_s=dwell_s)

    def advance_until(self, host: CanHost, frames: int, deadline_s: float) -> None:
        """Let whole quanta pass, at least one, until so many more frames have come for host, or deadline_s.

        The emulator looks after each quantum, so that time is where quantum after quantum would have brought it.
        """
        quantum_ns = round(QUANTUM_S * NS)
        quanta = max(1, math.ceil((deadline_s - self.now_s()) / QUANTUM_S) + 1)
        while quanta > 1 and (self._t_ns + (quanta - 1) * quantum_ns) * 1e-9 >= deadline_s:
            quanta -= 1
        args: dict[str, object] = {"for_s": min(quanta, BULK_QUANTA) * quantum_ns / NS}
        if frames > 0 and quanta > 1:
            k = self._hosts.index(host) if self._hosts else 0
            args |= {"rx": self._base_rx[k] + host.received + frames}
            args |= {"client": self._mine[k]} if self._mine else {}
        self.command(host, "run", **args)

    def command(self, host: CanHost | None, name: str, **args: object) -> Reply:
        """A command that moves time, `run` or `run.until`; returns when every frame of that time has come.

        Raises TimeOut where it would move it past the deadline, or has brought it there.
        """
        hosts = self._hosts or ([] if host is None else [host])
        reply = self._control.call(name, **self._run_args(hosts, args))
        self._t_ns = reply.t_ns
        for h, count in zip(hosts, self._counts(reply), strict=False):
            _receive_all(h, count)
        self._check_deadline()
        self.between()
        return reply

    def resync(self) -> None:
        """Another program has moved time, or has sent frames: both are counted from here on."""
        reply = self._control.call("frames")
        self._t_ns = reply.t_ns
        self._base_tx = _frames_taken(reply) - sum(h.sent for h in self._hosts)

    def start_run(self, dwell_s: float) -> None:
        """Let time pass while this program does something else, which sends nothing; `finish_run` waits for its end."""
        self._control.send("run", **self._run_args(self._hosts, {"for_s": dwell_s}))

    def finish_run(self) -> list[int]:
        """Time is where `start_run` brings it. Returns how many frames each of the hosts has got by then.

        They are taken by `CanHost.receive_up_to`: those of a next run may already be behind them.
        """
        reply = self._control.wait_reply("run")
        self._t_ns = reply.t_ns
        self._check_deadline()
        return self._counts(reply)

    def _run_args(self, hosts: Sequence[CanHost], args: dict[str, object]) -> dict[str, object]:
        """Not beyond the deadline, and not before the emulator has our frames."""
        if "for_s" in args:
            args["for_s"] = max(0.0, min(float(str(args["for_s"])), round(self.deadline_s - self.now_s(), 9)))
        # after_tx: what we have sent takes another way than this command, and must not be overtaken by it
        return args | {"after_tx": self._base_tx + sum(h.sent for h in hosts)}

    def _check_deadline(self) -> None:
        if self.now_s() >= self.deadline_s:
            raise TimeOut(f"simulated time ends at {self.deadline_s:.6g} s")

    def _counts(self, reply: Reply) -> list[int]:
        """Frames that our hosts have got by then, since they came."""
        return [delivered - base for delivered, base in zip(self._delivered(reply), self._base_rx, strict=False)]

    def _delivered(self, reply: Reply) -> list[int]:
        """Frames handed to each of our hosts so far."""
        return [reply.rx.get(client, 0) for client in self._mine] or [reply.can_rx]


def _frames_taken(frames: Reply) -> int:
    """How many frames the emulator has taken from all that have been on its buses."""
    return sum(int(c["taken"]) for c in [*frames.result["clients"], frames.result["gone"]])


def _frames_of_all(control: Control, hosts: Sequence[CanHost]) -> Reply:
    """`frames` when the emulator has all these hosts: a serial one joins by bytes that no one waits for.

    Raises LinkError where one does not join.
    """
    deadline_s = time.monotonic() + BARRIER_S
    reply = control.call("frames")
    while any(h.joins_later for h in hosts) and len(reply.rx) < len(hosts):
        if time.monotonic() > deadline_s:
            raise LinkError(expected(f"{len(hosts)} clients within {BARRIER_S:g} s", len(reply.rx), "CAN"))
        reply = control.call("frames")
    return reply


def _receive_all(host: CanHost, sent: int) -> None:
    """Receive until the host has all frames that the emulator has sent it."""
    while (missing := sent - host.received) > 0:
        if not host.receive(BARRIER_S):
            raise LinkError(f"CAN: {missing} frames sent by the emulator did not arrive within {BARRIER_S:g} s")
        host.receive_taken()
    while host.shared and host.receive(0.0):
        pass  # frames of others were counted for the emulator's; all of its own are with our kernel by now


class CanHost(AbstractContextManager["CanHost"]):
    """A python-can bus with a clock. `sent` and `received` count frames; listeners get the received ones, in order.

    Those who have named NMT among their identifiers get the commands that this program sends, too: a stream that it
    stops is stopped as by any other master.

    shared: frames of other programs may come that have not passed through the emulator (an interface of the kernel).
    """

    def __init__(self, bus: can.BusABC, clock: Clock) -> None:
        self.bus = bus
        self.clock = clock
        self.shared = isinstance(bus, SocketcanBus | LocalUdpBus)
        self.counted = isinstance(bus, SocketcandBus)  # what it delivers are the emulator's frames, and TCP holds many
        self.joins_later = isinstance(bus, slcanBus)  # its opening is bytes on their way
        self.received = self.sent = 0
        self.listeners = Listeners()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        with suppress(can.CanError):  # slcan says good-bye to an adapter that may have gone
            self.bus.shutdown()

    def reopen(self, bus: can.BusABC) -> None:
        """Go on with another connection after `close`; frames are counted again."""
        self.bus = bus
        self.received = self.sent = 0

    def receive(self, timeout_s: float) -> bool:
        """Take one frame if one comes within timeout_s. Raises LinkError when the link has gone."""
        message = self._take(min(timeout_s, LOOK_S)) or self._wait(timeout_s - LOOK_S)
        if message is None:
            return False
        self._hand_on([message])
        return True

    def receive_taken(self, most: int | None = None) -> None:
        """What came together with the last frame, where the bus takes many at once."""
        if isinstance(self.bus, SocketcandBus) and self.bus.filters is None:
            self._hand_on(self.bus.taken(most))

    def receive_turn(self, timeout_s: float) -> bool:
        """Take a frame that comes within timeout_s and those behind it, TURN at most; whether there were any.

        So a bus on which frames come faster than they are taken keeps no other waiting.
        """
        if not self.receive(timeout_s):
            return False
        if self.counted:
            self.receive_taken(TURN - 1)
        else:
            all(self.receive(0.0) for _ in range(TURN - 1))  # until one says no
        return True

    def receive_up_to(self, count: int) -> None:
        """Until so many frames have come, and none beyond them. Raises LinkError when they do not."""
        while (missing := count - self.received) > 0:
            if not self.receive(BARRIER_S):
                raise LinkError(f"CAN: {missing} frames sent by the emulator did not arrive within {BARRIER_S:g} s")
            self.receive_taken(count - self.received)

    def _hand_on(self, messages: list[Message]) -> None:
        for message in messages:
            self.received += not message.is_error_frame  # socketcand reports a rejection as one; it was on no bus
            self.listeners.hand_on(message)

    def _wait(self, left_s: float) -> Message | None:
        """A frame within left_s, after a look at the link and one each LOOK_S."""
        message = None
        while message is None:
            if _hung_up(self.bus):
                raise LinkError("CAN: connection closed by the emulator or adapter")
            if left_s <= 0.0:
                return None
            message = self._take(min(left_s, LOOK_S))
            left_s -= LOOK_S
        return message

    def _take(self, timeout_s: float) -> Message | None:
        try:
            return self.bus.recv(timeout_s)
        except (can.CanError, OSError) as e:
            raise LinkError(f"CAN: {_reason(e)}; the emulator or adapter has gone away") from e

    def send(self, can_id: int, data: bytes, *, fd: bool = False, remote: bool = False) -> None:
        """Send a frame with an 11-bit identifier; remote: a remote frame that asks for len(data). Raises LinkError."""
        message = can.Message(
            arbitration_id=can_id,
            data=None if remote else data,
            dlc=len(data),
            is_extended_id=False,
            is_fd=fd,
            bitrate_switch=fd,
            is_remote_frame=remote,
            check=True,
        )
        try:
            self.bus.send(message, timeout=1.0)
        except (can.CanError, OSError) as e:
            raise LinkError(f"CAN: cannot send {can_id:03X}h: {_reason(e)}") from e
        self.sent += 1
        self.echo_nmt(can_id, data)

    def echo_nmt(self, can_id: int, data: bytes) -> None:
        """What this program has sent, to those of its own who have named NMT."""
        if can_id == NMT:
            self.listeners.hand_on_named(can.Message(arbitration_id=NMT, data=data, is_extended_id=False, is_rx=False))

    def advance(self, dwell_s: float) -> None:
        self.clock.advance(self, dwell_s)

    def pump_until(self, done: Callable[[], bool], timeout_s: float, least: Callable[[], int] = lambda: 1) -> bool:
        """Let time pass until done() is true; False after timeout_s of bench time.

        done() is asked after each frame that came, or later: least() is how many more must come, at the least, before
        it can be true. In step pace the emulator takes time there in one go.
        """
        deadline_s = self.clock.now_s() + timeout_s
        while not done():
            if self.clock.now_s() >= deadline_s:
                return False
            self._advance_until(least(), deadline_s)
        return True

    def _advance_until(self, frames: int, deadline_s: float) -> None:
        if isinstance(self.clock, StepClock) and self.clock.in_bulk:
            self.clock.advance_until(self, frames, deadline_s)
        else:
            self.advance(QUANTUM_S)


def open_bus(spec: str | None) -> can.BusABC:
    """Open `INTERFACE:CHANNEL[,key=value...]` of python-can, or python-can's own configuration when spec is None.

    socketcand takes HOST:PORT as its channel: "socketcand:127.0.0.1:29536"; others the device, and options after
    commas: "slcan:/dev/pts/7"; "socketcan:vcan0,fd=true"; "udp:239.74.163.2:43113";
    "cannelloni:20000".
    Raises BadInput for a spec no one can use, LinkError when the link is not there.
    """
    arguments = _bus_arguments(spec)
    if arguments.get("interface") == "socketcand":
        _greet(arguments["host"], arguments["port"])
    try:
        bus = _open_interface(arguments)
        if isinstance(bus, SocketcanBus):
            _enlarge_buffer(bus.socket)
        if (port := getattr(bus, "serialPortOrig", None)) is not None:
            bus.serialPortOrig = ReadAhead(port)  # type: ignore[attr-defined]
        return bus
    except (can.CanInterfaceNotImplementedError, ValueError, TypeError) as e:
        if spec is None:
            what = "INTERFACE:CHANNEL[,key=value], or an interface in $CAN_INTERFACE or ~/.canrc"
            raise BadInput(expected(what, f"none that python-can opens ({e})", "--can")) from e
        raise BadInput(expected("INTERFACE:CHANNEL[,key=value]", e, f"--can {spec}")) from e
    except (can.CanError, OSError) as e:
        raise link_error(f"--can {spec}", "a CAN adapter", e) from e


def _open_interface(arguments: dict[str, Any]) -> can.BusABC:
    own: dict[Any, type[can.BusABC]] = {
        "udp": LocalUdpBus,
        "cannelloni": CannelloniBus,
        "socketcand": SocketcandBus,
    }
    if bus := own.get(arguments.get("interface")):
        return bus(**{k: v for k, v in arguments.items() if k != "interface"})
    return can.Bus(**arguments)


class ReadAhead:
    """A serial port that gives single bytes of what it took at once: python-can's slcan asks the kernel for each."""

    def __init__(self, port: Any) -> None:
        self._port = port
        self._bytes: Iterator[int] = iter(b"")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)

    @property
    def in_waiting(self) -> int:
        return length_hint(self._bytes) or int(self._port.in_waiting)

    def read(self, _: int = 1) -> bytes:
        """One byte; none when the port's timeout is over."""
        if not length_hint(self._bytes):
            self._bytes = iter(self._port.read(max(1, self._port.in_waiting)))
        return bytes(islice(self._bytes, 1))

    def reset_input_buffer(self) -> None:
        self._bytes = iter(b"")
        self._port.reset_input_buffer()


def _greet(host: str, port: int) -> None:
    """Make sure that a server is there: python-can would try for 10 s, a warning each time, or wait without end."""
    try:
        with socket.create_connection((host, port), GREETING_S) as s:
            hello = s.recv(256)
    except OSError as e:
        where = f"--can socketcand:{host}:{port}"
        raise link_error(where, "a socketcand server", e, "is psa-emu running there?") from e
    if hello != b"< hi >":
        raise LinkError(expected("a socketcand server", "another answer", f"--can socketcand:{host}:{port}"))


def _reason(e: BaseException) -> str:
    """One line of an error, that of its cause where there is one: python-can's own may hold a whole traceback."""
    cause = e.__cause__ or e
    return str(getattr(cause, "strerror", None) or cause).partition("\n")[0]


def _hung_up(bus: can.BusABC) -> bool:
    """Whether a socketcand server has closed the connection: python-can's client takes the end for silence."""
    s = getattr(bus, "_SocketCanDaemonBus__socket", None)
    try:
        return s is not None and s.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def _enlarge_buffer(s: socket.socket) -> None:
    """The kernel's usual buffer holds a few hundred frames, a tenth of a second, and loses what does not fit."""
    try:
        s.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RCVBUF)
    except PermissionError:
        s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RCVBUF)  # up to net.core.rmem_max


def _bus_arguments(spec: str | None) -> dict[str, Any]:
    if spec is None:
        return {}  # $CAN_INTERFACE, ~/.canrc: see python-can
    head, *pairs = spec.split(",")
    interface, _, channel = head.partition(":")
    if not channel or not all("=" in p for p in pairs):
        raise BadInput(expected("INTERFACE:CHANNEL[,key=value], e.g. socketcand:127.0.0.1:29536", repr(spec), "--can"))
    arguments: dict[str, Any] = {"interface": interface, "channel": channel}
    if interface == "socketcand":
        host, _, port = channel.rpartition(":")
        if not port.isdecimal():
            raise BadInput(expected("socketcand:HOST:PORT, e.g. socketcand:127.0.0.1:29536", repr(spec), "--can"))
        arguments |= {"channel": "can0", "host": host, "port": int(port), "tcp_tune": True}
    if interface == "udp":
        arguments |= dict(zip(("channel", "port"), group_of(channel), strict=True))
    if interface == "slcan":
        arguments["sleep_after_open"] = 0.0  # an emulator needs no 2 s to wake up
    return arguments | {k: _value(v) for k, v in (p.split("=", 1) for p in pairs)}


def _value(text: str) -> bool | int | float | str:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text
