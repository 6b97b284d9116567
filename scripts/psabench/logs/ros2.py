"""A ROS 2 bag (MCAP) of sensor_msgs/Imu from a PSA-2's frames, without ROS: for rosbag tools, Allan variance, kalibr.

linear_acceleration is U / k * g0 in m/s^2, with one nominal scale k in V/g for all axes: a calibration is not applied.
Orientation and angular velocity are unknown: their covariance begins with -1, as REP 145 has it. Stamps are those of
reception; sources: docs.ros.org (sensor_msgs/msg/Imu), mcap.dev/spec/registry.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import can
from mcap_ros2._dynamic import serialize_dynamic

from psabench.boards.psa2.frames import FrameReader, Frames
from psabench.errors import output_error
from psabench.link.own import Owned
from psabench.logs.mcap_log import ChunkFile
from psabench.logs.records import stamp_ns

G0_MPS2 = 9.80665
BATCH = 4096  # messages of a chunk
UNKNOWN = [-1.0] + [0.0] * 8
RULE = "\n" + "=" * 80 + "\n"
IMU = f"""\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance{RULE}\
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id{RULE}\
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec{RULE}\
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w{RULE}\
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def imu(t_s: float, accel_mps2: Iterable[float], frame_id: str) -> dict[str, Any]:
    """One message as mcap-ros2-support takes it."""
    seconds, ns = divmod(stamp_ns(t_s), 1_000_000_000)
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    return {
        "header": {"stamp": {"sec": seconds, "nanosec": ns}, "frame_id": frame_id},
        "orientation": {**zero, "w": 1.0},
        "orientation_covariance": UNKNOWN,
        "angular_velocity": zero,
        "angular_velocity_covariance": UNKNOWN,
        "linear_acceleration": dict(zip("xyz", map(float, accel_mps2), strict=True)),
        "linear_acceleration_covariance": [0.0] * 9,
    }


class ImuFile:
    """The bag: one topic, /nodeN/imu."""

    def __init__(self, path: Path, node: int, v_per_g: float) -> None:
        """Raises OSError."""
        self._node, self._v_per_g, self._encode = node, v_per_g, serialize_dynamic("sensor_msgs/msg/Imu", IMU)
        self._file = ChunkFile(path, profile="ros2")
        writer = self._file.writer
        schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", IMU.encode())
        self._channel = writer.register_channel(f"/node{node}/imu", "cdr", schema, {"v_per_g": f"{v_per_g:g}"})
        self.stored = 0

    def add(self, frames: Frames) -> None:
        """Raises OSError."""
        accel_mps2 = frames.u_v / self._v_per_g * G0_MPS2
        for t_s, axes in zip(frames.t_rx_s.tolist(), accel_mps2.tolist(), strict=True):
            data = self._encode["sensor_msgs/msg/Imu"](imu(t_s, axes, f"node{self._node}"))
            self._file.writer.add_message(self._channel, stamp_ns(t_s), data, stamp_ns(t_s))
        if len(frames):
            self._file.commit()
            self.stored += len(frames)

    def finish(self) -> None:
        """Raises OSError."""
        self._file.finish()

    def close(self) -> None:
        self._file.close()


def write_imu(frames: Iterable[can.Message], path: Path, node: int, v_per_g: float) -> int:
    """The bag of one node's frames; how many messages it has. Raises BadInput, OutputError, and as `frames` does."""
    reader, owned = FrameReader(node), Owned(path)
    stored = 0
    try:
        bag = ImuFile(path, node, v_per_g)
        try:
            for m in frames:
                reader.on_message(m)
                if len(reader) >= BATCH:
                    bag.add(reader.take())
            bag.add(reader.take())
            bag.finish()
        finally:
            stored = bag.stored
            bag.close()
    except OSError as e:
        raise output_error(path, e, f"{stored} messages are stored") from e
    finally:
        owned.release()
    return stored
