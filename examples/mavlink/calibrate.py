"""Ask for a calibration as a ground station does: MAV_CMD_PREFLIGHT_CALIBRATION to psabench mavlink, which runs it."""

import sys

from psabench.mavlink.dialect import mavlink
from pymavlink import mavutil

CALIBRATE = 241
ACCEPTED, IN_PROGRESS = 0, 5

mavlink()
mavutil.set_dialect("psabench")
station = mavutil.mavlink_connection(sys.argv[1])
station.wait_heartbeat()
station.mav.command_long_send(station.target_system, station.target_component, CALIBRATE, 0, 0, 0, 0, 0, 1, 0, 0)
results, progress = {}, [0]
while True:
    m = station.recv_match(type=["COMMAND_ACK", "PSABENCH_RESULT"], blocking=True, timeout=60)
    if m is None:
        sys.exit("no answer within 60 s")
    if m.get_type() == "PSABENCH_RESULT":
        results[m.name] = f"{m.value:.5f} {m.unit}"
    elif m.result == IN_PROGRESS:
        progress.append(m.progress)
    else:
        break
print("done" if m.result == ACCEPTED else f"not done: result {m.result}", f"after {max(progress)} %")
for name in ("u0_v", "kx_v_per_g"):
    print(f"{name:12}", results.get(name, "none"))
