"""CAN over UDP multicast on this machine: python-can's udp_multicast bus with hop limit 0 and without its own echoes.

A datagram comes back to each member of its group, the sender included, and python-can takes it for a frame of another
node. This bus sends from a port of its own and passes over what comes from there. Source of the frame format:
python-can 4.6, interfaces/udp_multicast.
"""

from __future__ import annotations

import ipaddress
import re
import socket
from typing import Any

import can
from can.interfaces.udp_multicast import UdpMulticastBus
from can.interfaces.udp_multicast.utils import pack_message, unpack_message

from psabench.errors import BadInput, expected

PORT = 43113  # python-can's
RCVBUF = 4 << 20  # bytes, up to net.core.rmem_max
FORM = "udp:GROUP, udp:GROUP:PORT or udp:[GROUP]:PORT, GROUP 239.x.y.z or ff..::.."


def group_of(text: str) -> tuple[str, int]:
    """Multicast group and port of "GROUP", "GROUP:PORT" or "[GROUP]:PORT". Raises BadInput."""
    found = re.fullmatch(r"\[(?P<a>[^]]*)\](:(?P<p>\d+))?|(?P<b>[^:]*)(:(?P<q>\d+))?|(?P<c>.*)", text)
    parts = found.groupdict() if found else {}
    group = parts.get("a") or parts.get("b") or parts.get("c") or ""
    port = int(parts.get("p") or parts.get("q") or PORT)
    try:
        address = ipaddress.ip_address(group)
    except ValueError as e:
        raise BadInput(expected(FORM, repr(text), "--can udp")) from e
    administrative = address.version == 6 or group.startswith("239.")
    if not (address.is_multicast and administrative and 0 < port < 1 << 16):
        raise BadInput(expected(FORM, repr(text), "--can udp"))
    return group, port


class LocalUdpBus(UdpMulticastBus):
    """A member of a group on this machine: channel, port, fd as python-can's. Raises can.CanError, OSError."""

    def __init__(self, channel: str, port: int = PORT, **options: Any) -> None:
        super().__init__(channel, port, **(options | {"hop_limit": 0}))
        self._out = self._connect(channel, port)
        self._self = self._out.getsockname()[:2]
        socket.socket(fileno=socket.dup(self.fileno())).setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RCVBUF)

    @staticmethod
    def _connect(group: str, port: int) -> socket.socket:
        v6 = ":" in group
        out = socket.socket(socket.AF_INET6 if v6 else socket.AF_INET, socket.SOCK_DGRAM)
        if v6:
            out.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_HOPS, 0)
        else:
            out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        out.connect((group, port))
        return out

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one frame to the group; timeout is python-can's, a datagram does not wait."""
        self._out.send(pack_message(msg))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        got = self._multicast.recv(timeout)
        if got is None or got[1][:2] == self._self:
            return None, False
        try:
            return unpack_message(got[0], replace={"timestamp": got[2]}, check=True), False
        except Exception as e:  # whatever msgpack or Message makes of a stranger's datagram
            raise can.CanOperationError(f"a datagram that is no CAN frame: {e}") from e

    def shutdown(self) -> None:
        super().shutdown()
        self._out.close()
