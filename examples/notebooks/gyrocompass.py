# %% [markdown]
# # Gyrocompass
#
# A platform with one gyroscope is on a parked vehicle. Levelled, it still has to be turned against the Earth: the
# rate that the levelling loop asks of its torquer is the Earth's rate along the gyroscope's axis, plus the drift. In
# three directions the drift is the same and the Earth's part is not, so both follow ([the
# method](../../docs/procedures/gyrocompass.md)).

# %%
import matplotlib.pyplot as plt
import numpy as np
from psabench import Bench
from psabench.native.nav import DEGPH
from psabench.procedures.gyrocompass import estimate, measure
from psabench.procedures.gyrocompass_params import params_of
from psabench.procedures.head_bench import Silent
from psabench.procedures.wire_platform import WirePlatform

bench = Bench.start("gyrocompass", seed=1)
article = params_of("article", {"latitude_deg": 50.0})
windows = measure(WirePlatform(bench, signals=article.signals), article, Silent())
result = estimate(windows, article)
print(f"{len(windows)} windows, {result.duration_s:.0f} s of simulated time; doubts: {len(result.doubts)}")

# %% [markdown]
# ## What the loop asks for
#
# Each position has a window of ten seconds; the rest is turning and settling. The mean over the window is all that
# the article's method takes.

# %%
run = windows[:3]
fig, ax = plt.subplots(figsize=(8, 3.5))
for w in run:
    t_s = w.t_mid_s - run[0].t_mid_s + w.step_s * np.arange(len(w.beta_rad))  # from the first window's begin
    ax.plot(t_s, w.u1_radps / DEGPH, lw=0.5, label=f"gimbal at {np.degrees(w.set_rad):.0f} deg")
ax.set_xlabel("time, s")
ax.set_ylabel("levelling rate, deg/h")
ax.legend()
fig.tight_layout()
for w in run:
    print(f"{np.degrees(w.set_rad):5.0f} deg: {w.u1_radps.mean() / DEGPH:+8.3f} deg/h")

# %% [markdown]
# ## Heading, drifts and tilt
#
# ± is the half width of the 95 % interval. The budget says what it consists of.

# %%
for e in result.estimates:
    print(f"{e.name:14} {e.value:9.3f} +- {e.ci_half:.3f} {e.unit}")
for c in result.get("heading_deg").budget:
    print(f"  heading: {c.name:12} u = {c.u:.4f} deg")

# %% [markdown]
# ## A better way with the same instrument
#
# Most of that is the angle between positions, which the article's reading takes from the setting. Reading the
# encoder, turning back and forth faster and weighting the windows by their noise makes it smaller, in a run that
# takes longer.

# %%
bench.close()
bench = Bench.start("gyrocompass", seed=1)
improved = params_of("improved", {"latitude_deg": 50.0, "repeat": 2})
better = estimate(measure(WirePlatform(bench, signals=improved.signals), improved, Silent()), improved)
for name, found in (("article", result), ("improved", better)):
    e = found.get("heading_deg")
    print(
        f"{name:9} heading {e.value:.3f} +- {e.ci_half:.3f} deg, {found.duration_s:.0f} s, doubts: {len(found.doubts)}"
    )

# %% [markdown]
# ## Truth
#
# Only an emulator has it: where the vehicle really points. The zero of the angle sensor in this scenario is off by
# 6′, all of the limit in its passport; the intervals count it as anywhere within that limit. So the better run, whose
# scatter is small, misses by the same 0.1°: more windows do not help against it.

# %%
true_deg = float(bench.truth_state()["vehicle"]["heading_deg"])
print(f"the vehicle heads {true_deg:.3f} deg")
for name, found in (("article", result), ("improved", better)):
    e = found.get("heading_deg")
    error_deg = e.value - true_deg
    print(f"{name:9} error {error_deg:+.3f} deg, {abs(error_deg) / e.ci_half:.2f} of the interval's half width")
bench.close()
