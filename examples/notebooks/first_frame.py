# %% [markdown]
# # First frame
#
# A PSA-2 board digitises three accelerometer signals and sends a frame of four words, a thousand times a second. Here
# you start an emulated board, look at one frame on its lines edge by edge, decode it by hand, and compare it with
# what the CAN bus says. A driver that you write later does the same.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from psabench import Bench
from psabench.link.vcd import read_vcd

bench = Bench.start("stream", seed=1)  # an emulator of our own; its time moves only when we say so
bench.unit.wait_ready()
print(f"CONFIG0 of converter X: {bench.unit.register('x', 'CONFIG0'):02X}h, {bench.unit.data_hz} samples a second")
print(f"{bench.time_s * 1e3:.3f} ms of simulated time")

# %% [markdown]
# ## Record the lines
#
# `trace` writes a VCD file, which PulseView and GTKWave read as well. `run_until` stops exactly at an event: here
# twice at the rise of Int, which ends a frame. The frame on the bus has the same sample.

# %%
folder = TemporaryDirectory()
with bench.trace(Path(folder.name) / "frame.vcd") as path:
    bench.run_until("INT_RISE", count=2)
    bench.run_for(0.0002)
lines = read_vcd(path)
print(", ".join(lines.wires))

# %% [markdown]
# ## One frame
#
# Int is low while the board sends. Each bit of Data is stable at the rise of CLK.

# %%
fall_ns = int(lines.wires["Int"].edges_ns(0)[-1])
rise_ns = int(lines.wires["Int"].edges_ns(1)[-1])
clk_ns = lines.wires["CLK"].edges_ns(1)
clk_ns = clk_ns[(clk_ns > fall_ns) & (clk_ns < rise_ns)]
print(
    f"Int is low for {(rise_ns - fall_ns) / 1e3:.3f} us, {len(clk_ns)} bits, {np.diff(clk_ns).min()} ns from bit to bit"
)

fig, axes = plt.subplots(2, 1, figsize=(9, 5))
for ax, (begin_ns, end_ns) in zip(
    axes, [(fall_ns - 2000, rise_ns + 2000), (fall_ns - 500, int(clk_ns[23]))], strict=True
):
    for row, name in enumerate(("CLK", "Data", "Int")):
        wire = lines.wires[name]
        inside = (wire.t_ns > begin_ns) & (wire.t_ns < end_ns)
        t_ns = np.concatenate([[begin_ns], wire.t_ns[inside], [end_ns]])
        ax.step((t_ns - fall_ns) / 1e3, 1.5 * row + wire.at(t_ns), where="post", lw=0.8)
    ax.set_yticks([0.5, 2.0, 3.5], ["CLK", "Data", "Int"])
axes[0].set_title("A frame; its first bits below")
axes[1].set_xlabel("time after the fall of Int, us")
fig.tight_layout()

# %% [markdown]
# ## Decode it
#
# Four words of the same length, least significant bit first: X, Y and Z in two's complement. A code is 10 V / 2²³ at
# the load resistor of the sensor. The fourth word carries the temperature and its channel.

# %%
bits = lines.wires["Data"].at(clk_ns).astype(np.int64).reshape(4, -1)
word_bits = bits.shape[1]
words = (bits << np.arange(word_bits)).sum(axis=1)
codes = words[:3] - (words[:3] >> (word_bits - 1) << word_bits)
CODE_V = 10.0 / 2**23
for name, code in zip("XYZ", codes, strict=True):
    print(f"{name} {code:8d}  {code * CODE_V:+.6f} V")
print(f"T {words[3] & 0xFFFF:04X}h, channel {words[3] >> 16 & 15}")

# %% [markdown]
# ## The same by CAN, and how well it is known
#
# A single frame has the noise of a single conversion. The mean of n frames is known to s/√n, as long as the noise is
# white: the next notebook looks at that.

# %%
frames = bench.unit.stream(1000)
u_v = frames.axis("x")
sd_v = u_v.std(ddof=1)
mean_sd_v = sd_v / np.sqrt(len(u_v))
print(f"{len(frames)} frames, numbers without a gap: {bool((np.diff(frames.seq) == 1).all())}")
print(f"X = {u_v.mean():.7f} V +- {2 * mean_sd_v:.7f} V (k = 2); a single frame: +- {2 * sd_v:.7f} V")
print(f"the frame from the lines is {(codes[0] * CODE_V - u_v.mean()) / sd_v:+.1f} standard deviations off that mean")

# %% [markdown]
# ## Truth
#
# Only an emulator has this: the voltage that the sensor really gives. The tolerances of this chain are zero, and the
# filter of the converter has a known gain, which a host divides by.

# %%
axis = bench.truth()["units"]["a"]["axes"]["x"]
g = bench.truth_state()["unit"]["f_mps2"]
print(f"zero of the sensor: {axis['u0_v']:.4f} V; filter gain {bench.unit.filter_gain:.9f}")
true_v = float(bench.truth_state()["unit"]["sensor_v"][0]) * bench.unit.filter_gain
print(f"X should be {true_v:.7f} V: the mean is {(u_v.mean() - true_v) / mean_sd_v:+.1f} standard deviations off")
bench.close()
folder.cleanup()
