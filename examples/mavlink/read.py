"""Read a MAVLink system with pymavlink: acceleration, exact codes, a register; here a board of psa-emu --mavlink."""

import sys
from typing import Any

from psabench.mavlink.dialect import mavlink
from pymavlink import mavutil

TIMEOUT_S = 10

mavlink()  # the module that the build makes of proto/mavlink/psabench.xml: pymavlink finds it as "psabench"
mavutil.set_dialect("psabench")
if len(sys.argv) != 2:
    sys.exit("usage: read.py tcp:127.0.0.1:5760 (or udpin:127.0.0.1:14550, /dev/pts/3)")
try:
    station = mavutil.mavlink_connection(sys.argv[1])
except OSError as e:
    sys.exit(f"{sys.argv[1]}: {e}")


def receive(kind: str) -> Any:
    message = station.recv_match(type=kind, blocking=True, timeout=TIMEOUT_S)
    if message is None:
        sys.exit(f"{sys.argv[1]}: expected {kind} within {TIMEOUT_S} s, got none")
    return message


beat = receive("HEARTBEAT")
print(f"system {beat.get_srcSystem()}, component {beat.get_srcComponent()}")
imu = receive("HIGHRES_IMU")
print(f"specific force   {imu.xacc:8.3f} m/s2 along x")
exact = receive("PSABENCH_ACCEL")
print(f"voltage          {exact.volts[0]:8.3f} V, as on CAN: {exact.volts[0] == exact.code[0] * 10 / 2**23}")
station.mav.param_request_read_send(station.target_system, station.target_component, b"X_CONFIG0", -1)
value = receive("PARAM_VALUE")
print(f"{value.param_id:16} {value.param_value:8.0f}")
print(f"messages lost    {station.mav_loss:8}")
