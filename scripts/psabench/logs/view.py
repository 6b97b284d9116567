"""The live view: a Foxglove WebSocket server with the channels of an MCAP log, while the bus runs.

The channels: /can_raw, one of each message of the DBC that has been seen, /nodeN/imu (sensor_msgs/Imu) of a PSA-2, and
/view with the counters of this server, each LOOK_S. The server is the foxglove-sdk's, on 127.0.0.1. It holds BACKLOG
messages for each reader and drops the oldest for one that is slower: that reader compares what it got with /view.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import can
import foxglove
from foxglove import Channel, Schema
from mcap_ros2._dynamic import serialize_dynamic

from psabench.boards.psa2.frames import FrameReader
from psabench.errors import LinkError, listen_error
from psabench.link.can_host import CanHost, Message, WallClock
from psabench.link.record import ctrl_c_noted, receive_until
from psabench.logs.records import RAW_SCHEMA, RAW_TOPIC, Decoder, raw_record, schema, stamp_ns, units
from psabench.logs.ros2 import G0_MPS2, IMU, imu

HOST = "127.0.0.1"
SDK = "foxglove"  # its logger
VIEW_TOPIC = "/view"
BACKLOG = 4096  # messages for each reader
IMU_BATCH = 32
VIEW_SCHEMA = {
    "title": "view_counters",
    "type": "object",
    "properties": {
        name: {"type": "integer", "description": text}
        for name, text in (("frames", "CAN frames received"), ("decoded", "of them, decoded by the DBC"))
    },
}


@dataclass(slots=True)
class Viewed:
    """What went through the server."""

    frames: int = 0
    decoded: int = 0
    warnings: int = 0  # of the server: clients it dropped, messages it refused, messages a slow reader lost
    broken: str | None = None  # why the link ended, if it did


class Publisher:
    """Frames into the channels of one server."""

    def __init__(self, context: foxglove.Context, node: int, board: str, v_per_g: float) -> None:
        self._context, self._node, self._v_per_g = context, node, v_per_g
        self._decoder, self._channels = Decoder({node: board}), dict[str, Channel]()
        self._reader = FrameReader(node) if board == "psa2" else None
        self._encode = serialize_dynamic("sensor_msgs/msg/Imu", IMU)["sensor_msgs/msg/Imu"]
        self._last_ns = 0
        self.counts = Viewed()
        self._channel(RAW_TOPIC, lambda: Channel(RAW_TOPIC, schema=dict(RAW_SCHEMA), context=context))
        self._channel(VIEW_TOPIC, lambda: Channel(VIEW_TOPIC, schema=VIEW_SCHEMA, context=context))
        if self._reader is not None:
            self._imu_channel()

    def on_message(self, m: Message) -> None:
        self._last_ns = stamp_ns(m.timestamp)
        self._log(self._channels[RAW_TOPIC], raw_record(m))
        self.counts.frames += 1
        if decoded := self._decoder.decoded(m):
            topic, name, values = decoded
            self._log(self._channel(topic, lambda: self._decoded_channel(topic, name)), values)
            self.counts.decoded += 1
        if self._reader is not None:
            self._reader.on_message(m)
            if len(self._reader) >= IMU_BATCH:
                self._log_imu()

    def look(self) -> None:
        """Each LOOK_S: what is collected, and the counters."""
        self._log_imu()
        counters = {"frames": self.counts.frames, "decoded": self.counts.decoded}
        self._log(self._channels[VIEW_TOPIC], counters)

    def _channel(self, topic: str, make: Callable[[], Channel]) -> Channel:
        if topic not in self._channels:
            self._channels[topic] = make()
        return self._channels[topic]

    def _log(self, channel: Channel, record: dict[str, Any]) -> None:
        text = json.dumps(record, separators=(",", ":"))
        channel.log(text.encode(), log_time=self._last_ns)

    def _decoded_channel(self, topic: str, name: str) -> Channel:
        return Channel(topic, schema=schema(name), metadata=units(name), context=self._context)

    def _imu_channel(self) -> Channel:
        topic = f"/node{self._node}/imu"
        kind = Schema(name="sensor_msgs/msg/Imu", encoding="ros2msg", data=IMU.encode())
        return self._channel(topic, lambda: Channel(topic, schema=kind, message_encoding="cdr", context=self._context))

    def _log_imu(self) -> None:
        if self._reader is None or not len(self._reader):
            return
        channel = self._imu_channel()
        frames = self._reader.take()
        accel_mps2 = frames.u_v / self._v_per_g * G0_MPS2
        for t_s, axes in zip(frames.t_rx_s.tolist(), accel_mps2.tolist(), strict=True):
            data = self._encode(imu(t_s, axes, f"node{self._node}"))
            channel.log(data, log_time=stamp_ns(t_s))


def view(
    bus: can.BusABC,
    port: int,
    node: int,
    board: str = "psa2",
    for_s: float | None = None,
    v_per_g: float = 1.0,
    ready: Callable[[str], object] = print,
) -> Viewed:
    """Serve until for_s of wall time have passed, or Ctrl-C, or the link ends. Call it on the main thread.

    port: 0 takes a free one. ready: gets the address when clients can connect. Raises LinkError for a port in use.
    """
    context = foxglove.Context()
    publisher = Publisher(context, node, board, v_per_g)  # its channels first: a client may subscribe at once
    with (
        _Warnings() as warnings,
        ctrl_c_noted() as pressed,
        CanHost(bus, WallClock()) as host,
        closing(_Server(context, port)) as server,
    ):
        host.listeners.append(publisher.on_message)
        ready(f"ws://{HOST}:{server.port}")
        try:
            receive_until(host, for_s, None, pressed, publisher.look)
        except LinkError as e:
            publisher.counts.broken = str(e)
        publisher.look()
        publisher.counts.warnings = warnings.count
        return publisher.counts


class _Warnings(logging.Handler):
    """Counts what the SDK says of its clients, in place of a line on stderr for each."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.count = 0

    def emit(self, record: logging.LogRecord) -> None:
        self.count += 1

    def __enter__(self) -> _Warnings:
        logging.getLogger(SDK).addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger(SDK).removeHandler(self)


class _Server:
    """The SDK's server; `close` waits until its threads are gone."""

    def __init__(self, context: foxglove.Context, port: int) -> None:
        try:
            self._server = foxglove.start_server(
                name="psabench", host=HOST, port=port, context=context, message_backlog_size=BACKLOG
            )
        except (OSError, RuntimeError) as e:
            raise listen_error("--port", port, e) from e
        self.port = int(self._server.port)

    def close(self) -> None:
        self._server.stop()
