# %% [markdown]
# # Calibration with its uncertainty budget
#
# An accelerometer is on a dividing head. Six positions put each of its axes along gravity and against it; half the
# sum of two readings is the zero, half the difference the sensitivity ([test turns](../../docs/procedures/turns.md)).
# You run it, see where its uncertainty comes from, and what of it would go away with more readings.

# %%
import matplotlib.pyplot as plt
import numpy as np
from psabench import Bench
from psabench.boards.psa2.device import CODE_V
from psabench.budget.accuracy import BenchAccuracy
from psabench.budget.influences import expand_result
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.turns import TurnsParams, turns
from psabench.procedures.wire_bench import WireBench
from psabench.report.grading import Section, grade

bench = Bench.start("realistic", seed=7)  # a production unit: noise, tolerances, a head that errs
head = WireBench(bench.unit, bench.head, average=16, g_mps2=9.8094)
params = TurnsParams(axis="x", realisations=5, readings=16)
measured = turns(head, params)
print(f"{len(measured.readings)} readings in {measured.duration_s:.0f} s of bench time; doubts: {len(measured.doubts)}")

# %% [markdown]
# ## What was read
#
# Voltage against the angle of the head; below what is left of each reading after the fit, a thousand times smaller.

# %%
fig, axes = plt.subplots(2, 1, figsize=(8, 5), sharex=True)
for s in measured.series:
    alpha_deg = (s.alpha_deg + 45) % 360 - 45
    axes[0].plot(alpha_deg, s.u_v, ".", ms=4, label=f"face {s.face.value}")
    axes[1].plot(alpha_deg, 1e3 * s.residual_v, ".", ms=3)
axes[0].set_ylabel("output, V")
axes[0].legend()
axes[1].set_ylabel("residual, mV")
axes[1].set_xlabel("head, deg")
fig.tight_layout()

# %% [markdown]
# ## The budget
#
# Scatter is what the readings show (type A). What they do not show comes from what is known of the bench (type B):
# gain, zero and temperature of the measuring chain, the head's circle, the mounting. Give the figures of your own
# bench here.

# %%
accuracy = BenchAccuracy(chain_gain_ppm=50, chain_zero_uv=100, circle_arcsec=3, mount_arcsec=3)
result = expand_result(measured, PROCEDURES["turns"], params, accuracy, CODE_V)
for name in ("u0_v", "kx_sum_v_per_g", "ky_sum_v_per_g", "kz_sum_v_per_g"):
    e = result.get(name)
    print(f"{e.symbol:22} = {e.value:9.6f} +- {e.ci_half:.6f} {e.unit}")

names = ("u0_v", "kx_sum_v_per_g")
parts = list(dict.fromkeys(c.name for n in names for c in result.get(n).budget))
fig, ax = plt.subplots(figsize=(8, 3))
for k, name in enumerate(names):
    u = {c.name: c.u for c in result.get(name).budget}
    ax.barh(np.arange(len(parts)) + 0.4 * k, [1e6 * u.get(p, 0.0) for p in parts], 0.38, label=name)
ax.set_yticks(np.arange(len(parts)) + 0.2, parts)
ax.set_xlabel("standard uncertainty, uV or uV/g")
ax.legend()
fig.tight_layout()

# %% [markdown]
# ## Twenty times as many readings?
#
# Averaging makes the scatter smaller and nothing else. What remains is the bench: its floor is the root of the sum of
# the squares of type B.

# %%
for name in names:
    e = result.get(name)
    scatter = next(c.u for c in e.budget if c.name == "scatter")
    floor = np.sqrt(sum(c.u**2 for c in e.budget if c.name != "scatter"))
    many = np.hypot(scatter / np.sqrt(20), floor)
    print(
        f"{name:16} u now {1e6 * e.sd:5.1f}, with 20 times the readings {1e6 * many:5.1f}, floor {1e6 * floor:5.1f} uV"
    )

# %% [markdown]
# ## What was not measured
#
# Six positions know the axes only as the head shows them: with a mounting error the three k are sums. The procedure
# says so for each number, and what it would take.

# %%
for e in result.estimates:
    if not e.identifiable:
        print(f"{e.name}: {e.reason}")

# %% [markdown]
# ## Truth
#
# Only an emulator can be asked. E_n is the error over U; of good numbers one in 22 is beyond 1, and none should be
# beyond 2. The sensor drifts: its zero is compared as it was on average over the readings.

# %%
for g in grade(Section(label="", result=result, truth=bench.truth()["units"]["a"]["axes"]["x"])):
    if g.within is not None and g.error is not None:
        print(f"{g.estimate.name:16} error {1e6 * g.error:+7.1f} uV, E_n {g.en:+.2f}, within 2 U: {g.within}")
bench.close()
