"""Read a MAVLink system with pymavlink: acceleration, exact codes, a register; here a board of psa-emu --mavlink."""

import sys

from psabench.mavlink.dialect import mavlink
from pymavlink import mavutil

mavlink()  # the module that the build makes of proto/mavlink/psabench.xml: pymavlink finds it as "psabench"
mavutil.set_dialect("psabench")
station = mavutil.mavlink_connection(sys.argv[1])  # tcp:127.0.0.1:5760, udpin:127.0.0.1:14550, /dev/pts/3
beat = station.wait_heartbeat()
print(f"system {beat.get_srcSystem()}, component {beat.get_srcComponent()}")
imu = station.recv_match(type="HIGHRES_IMU", blocking=True)
print(f"specific force   {imu.xacc:8.3f} m/s2 along x")
exact = station.recv_match(type="PSABENCH_ACCEL", blocking=True)
print(f"voltage          {exact.volts[0]:8.3f} V, as on CAN: {exact.volts[0] == exact.code[0] * 10 / 2**23}")
station.mav.param_request_read_send(station.target_system, station.target_component, b"X_CONFIG0", -1)
value = station.recv_match(type="PARAM_VALUE", blocking=True)
print(f"{value.param_id:16} {value.param_value:8.0f}")
print(f"messages lost    {station.mav_loss:8}")
