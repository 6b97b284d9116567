"""CANopen services (NMT, SDO) over a `CanHost`. The only file that imports python-canopen.

python-canopen waits for answers in threads of its own; here the answer is received where the caller waits, so that it
also works while simulated time stands still between our own steps.
"""

from __future__ import annotations

import queue
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import can
import canopen
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from psabench.errors import DeviceError, LinkError
from psabench.link.can_host import CanHost

ANSWER_S = 5.0  # bench time: the controller may wait for a conversion, and in wall pace the machine may be busy
# Command specifiers, bits 7..5 of the first byte (CiA 301, 7.2.4.3): begins a transfer, and its answers or an abort.
INITIATE, ABORT = {0x20: 0x60, 0x40: 0x40}, 0x80

# Bytes of the types of numbers (CiA 301, 7.4.7); the others are characters.
DATA_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 1, 6: 2, 7: 4, 8: 4, 16: 3, 21: 8, 17: 8, 22: 3, 27: 8}


class _Network(canopen.Network):
    """python-canopen's network, sending and receiving through a CanHost."""

    def __init__(self, host: CanHost) -> None:
        super().__init__()
        self.host = host

    def on_message(self, m: can.Message) -> None:
        self.notify(m.arbitration_id, m.data, m.timestamp)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        if remote:
            raise ValueError("CAN: remote frames are not supported: several transports lose them")
        self.host.send(can_id, bytes(data))


class _Sdo(SdoClient):
    """An SDO client that lets the bench's time pass while it waits."""

    def __init__(self, node_id: int, od: canopen.ObjectDictionary, host: CanHost, timeout_s: float) -> None:
        super().__init__(0x600 + node_id, 0x580 + node_id, od)  # type: ignore[no-untyped-call]
        self.host = host
        self.timeout_s = timeout_s
        self._request = b""
        self._object = b""  # index and sub-index of the transfer under way, as on the wire

    def request_response(self, sdo_request: bytes) -> bytes:
        """As python-canopen's, but no answer that was already on its way (to somebody else) is taken for ours."""
        while self.host.receive(0.0):
            pass
        self._request = bytes(sdo_request)
        if self._request[0] & 0xE0 in INITIATE:
            self._object = self._request[1:4]
        answer: bytes = super().request_response(sdo_request)  # type: ignore[no-untyped-call]
        return answer

    def read_response(self) -> bytes:
        """The answer to our request: what a client before us asked for may come first, when its time stood still."""
        responses: queue.Queue[bytes] = self.responses
        deadline_s = self.host.clock.now_s() + self.timeout_s
        while True:
            if not self.host.pump_until(lambda: not responses.empty(), deadline_s - self.host.clock.now_s()):
                raise SdoCommunicationError(f"no SDO answer within {self.timeout_s:g} s")
            response = responses.get()
            if self._is_ours(response):
                break
        if response[0] == ABORT:
            raise SdoAbortedError(int.from_bytes(response[4:8], "little"))
        return response

    def _is_ours(self, response: bytes) -> bool:
        """Whether it can answer our request: of its kind, and of its object where the answer names one."""
        specifier = response[0] & 0xE0
        begun = INITIATE.get(self._request[0] & 0xE0)
        if specifier in (ABORT, begun):
            return response[1:4] == self._object
        return begun is None and specifier not in INITIATE.values()


@dataclass(frozen=True, slots=True, kw_only=True)
class Described:
    """An object as the EDS has it. default and limits: None where it says none."""

    index: int
    sub: int
    name: str
    data_bytes: int | None  # None: characters
    access: str  # const, ro, wo, rw
    default: Any
    low: Any
    high: Any
    real: bool  # IEEE 754, of data_bytes
    signed: bool  # an integer in two's complement


def _described(v: Any) -> Described:
    return Described(
        index=v.index,
        sub=v.subindex,
        name=str(v.name),
        data_bytes=DATA_BYTES.get(v.data_type),
        access=v.access_type,
        default=v.default,
        low=v.min,
        high=v.max,
        real=v.data_type in canopen.objectdictionary.FLOAT_TYPES,
        signed=v.data_type in canopen.objectdictionary.SIGNED_TYPES,
    )


@cache
def _dictionary(eds: Path, node_id: int) -> Any:
    """Read once for all buses: it takes 35 ms."""
    return canopen.import_od(str(eds), node_id)


class CanopenNode:
    """One node: objects by index and subindex, and its NMT state.

    Raises DeviceError with the node's abort code, LinkError when it does not answer.
    """

    def __init__(self, host: CanHost, node_id: int, eds: Path, *, timeout_s: float = ANSWER_S) -> None:
        """timeout_s: bench time for an answer."""
        self.host = host
        self.node_id = node_id
        network = _Network(host)
        remote = canopen.RemoteNode(node_id, _dictionary(eds, node_id))
        network.add_node(remote)
        self._od = remote.object_dictionary
        self._sdo = _Sdo(node_id, self._od, host, timeout_s)
        self._sdo.network = network
        answers = 0x580 + node_id
        network.subscribe(answers, self._sdo.on_response)
        host.listeners.append(network.on_message, (answers,))

    def has(self, index: int) -> bool:
        """Whether the EDS has the object."""
        return index in self._od

    def is_text(self, index: int, sub: int = 0) -> bool:
        """Whether the EDS has it as characters."""
        variable = self._od.get_variable(index, sub)
        return variable is not None and variable.data_type == canopen.objectdictionary.VISIBLE_STRING

    def title(self, index: int) -> str:
        """Name of an object, from the EDS."""
        return str(self._od[index].name)

    def names(self, index: int) -> dict[int, str]:
        """Sub-indices of an object (without 0) and their names, from the EDS."""
        entry = self._od[index]
        subs = {} if isinstance(entry, canopen.objectdictionary.ODVariable) else entry.subindices
        return {sub: str(v.name) for sub, v in subs.items() if sub}

    def default(self, index: int, sub: int = 0) -> Any:
        """Value of an object before anybody has written it, from the EDS; None: it says none, or has no such object."""
        variable = self._od.get_variable(index, sub)
        return None if variable is None else variable.default

    def objects(self) -> list[Described]:
        """All that the EDS has."""
        found = []
        for entry in self._od.values():
            single = isinstance(entry, canopen.objectdictionary.ODVariable)
            found += [_described(v) for v in ([entry] if single else entry.subindices.values())]
        return found

    def nmt(self, command: int) -> None:
        """01h start, 02h stop, 80h pre-operational, 81h reset node, 82h reset communication (CiA 301)."""
        self.host.send(0x000, bytes([command, self.node_id]))

    def read(self, index: int, sub: int = 0) -> Any:
        """Value of an object, typed as the EDS says."""
        variable = self._od.get_variable(index, sub)
        data = self._call(f"read {index:04X}h:{sub}", self._sdo.upload, index, sub)
        return variable.decode_raw(data) if variable is not None else data

    def write(self, index: int, sub: int, value: int | float | str) -> None:
        variable = self._od.get_variable(index, sub)
        if variable is None:
            raise DeviceError(f"write {index:04X}h:{sub}", 0x06020000, "no such object in the EDS")
        self._call(f"write {index:04X}h:{sub} = {value}", self._sdo.download, index, sub, variable.encode_raw(value))

    def read_raw(self, index: int, sub: int) -> bytes:
        """Bytes of an object, also of a sub-index that is not in the EDS: whether it is there the node says."""
        return bytes(self._call(f"read {index:04X}h:{sub}", self._sdo.upload, index, sub))

    def write_raw(self, index: int, sub: int, data: bytes) -> None:
        """Bytes to an object, as `read_raw`."""
        what = f"write {index:04X}h:{sub} = {int.from_bytes(data, 'little'):X}h"
        self._call(what, self._sdo.download, index, sub, data)

    def _call(self, what: str, transfer: Any, *args: Any) -> Any:
        try:
            return transfer(*args)
        except SdoAbortedError as e:
            raise DeviceError(f"node {self.node_id}: {what}", e.code, str(e).partition(",")[2].strip()) from e
        except SdoCommunicationError as e:
            raise LinkError(f"node {self.node_id}: {what}: {e}; is the unit powered and on this bus?") from e
