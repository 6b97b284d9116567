"""Read the stream with python-can, decode it with the DBC file, and count what is missing by its sequence number."""

from typing import Any

import can
import cantools

COUNT = 1000

dbc: Any = cantools.database.load_file("proto/psabench.dbc")
xy = dbc.get_message_by_name("PSA2_XY")
seq: int | None = None
lost = 0
volts: list[float] = []
only = [{"can_id": xy.frame_id, "can_mask": 0x7FF}]
with can.Bus(can_filters=only) as bus:  # CAN_INTERFACE, CAN_CHANNEL, CAN_CONFIG, or python-can's configuration file
    while len(volts) < COUNT:
        message = bus.recv(2.0)
        if message is None:
            raise SystemExit("stream: expected a PSA2_XY within 2 s, got none")
        values = xy.decode(message.data)
        now = int(values["SEQ"])
        lost += 0 if seq is None else (now - seq - 1) % 65536
        seq = now
        volts.append(float(values["X"]))
print(f"{len(volts)} samples, {lost} lost, X from {min(volts):.3f} to {max(volts):.3f} V")
