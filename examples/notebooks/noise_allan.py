# %% [markdown]
# # Noise and Allan deviation
#
# How long may you average? As long as the noise is white, a mean gets better with the root of its time. Where the
# zero wanders, more time makes it worse. The Allan deviation shows both in one curve: half the mean square of the
# difference between neighbouring means over τ, as its root.
#
# The unit has an accelerometer on X. Y is open, so its noise is that of the converter. What the accelerometer's noise
# is, the notebook finds out.

# %%
import matplotlib.pyplot as plt
import numpy as np
from psabench import Bench
from psabench.estimate.allan import allan_deviation, of_walk, of_white

SECONDS = 64
bench = Bench.start("noise_unit.yaml")
bench.unit.wait_ready()
hz = bench.unit.data_hz
frames = bench.unit.stream(SECONDS * hz, timeout_s=SECONDS + 5)
u_v = {"x": frames.axis("x"), "y": frames.axis("y")}
print(f"{len(frames)} frames, lost: {int((np.diff(frames.seq) % 65536 != 1).sum())}")
for axis, v in u_v.items():
    print(f"{axis}: mean {v.mean():+.6f} V, standard deviation {v.std() * 1e6:.2f} uV")

# %% [markdown]
# ## In time
#
# Means over a tenth of a second. A standard deviation alone does not say which of the two curves wanders.

# %%
fig, ax = plt.subplots(figsize=(8, 3))
for axis, v in u_v.items():
    means_uv = 1e6 * (v.reshape(-1, hz // 10).mean(axis=1) - v.mean())
    ax.plot(0.1 * np.arange(len(means_uv)), means_uv, lw=0.8, label=axis.upper())
ax.set_xlabel("time, s")
ax.set_ylabel("mean of 0.1 s, uV off the mean")
ax.legend()
fig.tight_layout()

# %% [markdown]
# ## Allan deviation
#
# The estimate from a record of T has a relative standard uncertainty of 1/√(2(T/τ − 1)) (IEEE Std 952): the bars
# below are two of them. At the shortest τ the converter's filter has smoothed the noise; from 10 ms on that no longer
# matters.

# %%
tau_s = np.array([0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0])
relative = 1.0 / np.sqrt(2.0 * (SECONDS / tau_s - 1.0))
sigma_uv = {axis: np.array([1e6 * allan_deviation(v, 1.0 / hz, tau) for tau in tau_s]) for axis, v in u_v.items()}

fig, ax = plt.subplots(figsize=(8, 4))
for axis, s in sigma_uv.items():
    ax.errorbar(tau_s, s, yerr=2 * relative * s, marker="o", ms=3, lw=0.8, capsize=2, label=axis.upper())
ax.set_xscale("log")
ax.set_yscale("log")
ax.set_xlabel("averaging time, s")
ax.set_ylabel("Allan deviation, uV")
ax.legend()
ax.grid(which="both", alpha=0.3)
fig.tight_layout()
print("tau, s   X, uV             Y, uV")
for tau, r, x, y in zip(tau_s, relative, sigma_uv["x"], sigma_uv["y"], strict=True):
    print(f"{tau:6.2f}   {x:6.3f} +- {2 * r * x:6.3f}   {y:6.4f} +- {2 * r * y:6.4f}")

# %% [markdown]
# ## What it says
#
# On the left X falls as 1/√τ: white noise of density d has d/√(2τ). On the right it rises as √τ: a random walk of K
# per root second has K√(τ/3). d is read where white noise dominates, K where the walk does, after the white part is
# taken off. Y does not rise: the converter is not what wanders.


# %%
def at(tau: float) -> tuple[float, float]:
    """Allan deviation of X and its standard uncertainty, uV."""
    k = int(np.flatnonzero(tau_s == tau)[0])
    return float(sigma_uv["x"][k]), float(relative[k] * sigma_uv["x"][k])


short_uv, short_sd_uv = at(0.02)
long_uv, long_sd_uv = at(4.0)
density = short_uv / of_white(1.0, 0.02)
density_sd = density * short_sd_uv / short_uv
walk_part_uv = np.sqrt(long_uv**2 - of_white(density, 4.0) ** 2)
walk = walk_part_uv / of_walk(1.0, 4.0)
walk_sd = walk * long_uv * long_sd_uv / walk_part_uv**2
best_s = density / walk * np.sqrt(1.5)
print(f"white noise   d = {density:.2f} +- {2 * density_sd:.2f} uV/rtHz (k = 2)")
print(f"random walk   K = {walk:.1f} +- {2 * walk_sd:.1f} uV/rts (k = 2)")
print(f"longest mean that helps: about {best_s:.1f} s")

# %% [markdown]
# ## Truth
#
# Only an emulator tells what is hidden in the sensor. The converter adds white noise of its own to d: that of Y.

# %%
hidden = bench.truth()["units"]["a"]["axes"]["x"]
converter = sigma_uv["y"][1] / of_white(1.0, 0.02)
true_density = np.hypot(1e6 * hidden["noise_v_rthz"], converter)
true_walk = 1e6 * hidden["walk_v_rts"]
print(f"d: sensor and converter {true_density:.2f} uV/rtHz, found {(density - true_density) / density_sd:+.1f} u off")
print(f"K: {true_walk:.1f} uV/rts, found {(walk - true_walk) / walk_sd:+.1f} u off")
bench.close()
