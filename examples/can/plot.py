"""Record two seconds of X and Z and plot them against the board's own time stamps: build/run/plot.png."""

from typing import Any

import can
import cantools
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

COUNT = 2000
TICK_S, WRAP = 4e-6, 1 << 16  # of TSTAMP

dbc: Any = cantools.database.load_file("proto/psabench.dbc")
rows: dict[str, list[float]] = {"X": [], "Z": [], "TSTAMP": []}
only = [{"can_id": dbc.get_message_by_name(name).frame_id, "can_mask": 0x7FF} for name in ("PSA2_XY", "PSA2_ZT")]
with can.Bus(can_filters=only) as bus:
    while len(rows["TSTAMP"]) < COUNT:
        message = bus.recv(2.0)
        if message is None:
            raise SystemExit("plot: expected a sample within 2 s, got none")
        for name, value in dbc.decode_message(message.arbitration_id, message.data).items():
            if name in rows and (rows["X"] or name == "X"):  # begin with X; its Z follows
                rows[name].append(float(value))
ticks = np.rint(np.array(rows["TSTAMP"]) / TICK_S)
t_s = np.concatenate(([0.0], np.cumsum(np.diff(ticks) % WRAP))) * TICK_S  # the stamp wraps after 0.26 s
figure, axes = plt.subplots(2, 1, sharex=True)
for axis, name in zip(axes, "XZ", strict=True):
    axis.plot(t_s, rows[name][: len(t_s)], linewidth=0.7)
    axis.set_ylabel(f"{name}, V")
axes[-1].set_xlabel("time of the sample, s")
figure.savefig("build/run/plot.png")
print(f"build/run/plot.png: {len(t_s)} samples, {t_s[-1]:.3f} s")
