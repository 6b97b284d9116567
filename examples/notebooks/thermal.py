# %% [markdown]
# # Thermal compensation
#
# Three quartz accelerometers, on a dividing head in a chamber. The traditional method dwells at each temperature; the
# continuous one records while the chamber sweeps up and down. Both give a polynomial that a navigation computer takes
# out ([the procedure](../../docs/procedures/thermal.md)). The unit here is small and its lags are short: 46 minutes
# of chamber time instead of eight hours, a few seconds for you.

# %%
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from psabench.procedures.head_bench import Silent
from psabench.report.grading import aligned
from psabench.report.thermal_grading import graded_report, graded_table, read_truth
from psabench.thermal.leftover import element_of
from psabench.thermal.run import ThermalOptions, run_thermal

FILES = Path("../thermal")
stack = ExitStack()
folder = Path(stack.enter_context(TemporaryDirectory()))
options = ThermalOptions(
    out=folder, scenario=FILES / "small_unit.yaml", schedule=str(FILES / "small_schedule.yaml"), seed=3
)
run = stack.enter_context(run_thermal(options, Silent()))
result = run.result
minutes = (result.recordings[-1].t_s - result.recordings[0].t_s) / 60
print(f"{len(result.recordings)} recordings in {minutes:.0f} minutes of chamber time; notes: {len(result.notes)}")

# %% [markdown]
# ## The run
#
# Five temperatures with a dwell, then the sweep. The case lags behind the chamber, the element of a sensor behind the
# case.

# %%
t_min = np.array([r.t_s - result.recordings[0].t_s for r in result.recordings]) / 60
fig, ax = plt.subplots(figsize=(8, 3))
ax.plot(t_min, [r.chamber_degc for r in result.recordings], lw=0.8, label="chamber")
ax.plot(t_min, [r.case_degc for r in result.recordings], lw=0.8, label="case")
ax.set_xlabel("time, min")
ax.set_ylabel("temperature, °C")
ax.legend()
fig.tight_layout()

# %% [markdown]
# ## Zero against temperature
#
# Against the temperature of the case the sweep makes a loop: the element is somewhere else. Against that of the
# element, whose lag the fit finds, the loop is nearly closed. What remains is the effect of the difference between case
# and element, which the fit has as a column of its own.

# %%
QUANTITY = "zero_x_ug"
soak, sweep = result.methods
lag = sweep.fits[QUANTITY].best.lag
assert lag is not None  # a sweep of both legs has one
element_c = element_of(sweep.points, sweep.fits[QUANTITY].best)
points_ug = sweep.points.quantity(QUANTITY)
fig, axes = plt.subplots(1, 2, figsize=(9, 3.5), sharey=True)
grid_c = np.linspace(20, 50, 100)
for ax, at_c, name in ((axes[0], sweep.points.case_c, "case"), (axes[1], element_c, "element")):
    ax.plot(at_c, points_ug, ".", ms=3, label="sweep")
    ax.plot(soak.points.case_c, soak.points.quantity(QUANTITY), "s", ms=5, label="soak")
    ax.plot(grid_c, soak.fits[QUANTITY].best.value_at(grid_c), lw=0.8, label="fit of the soak")
    ax.set_xlabel(f"temperature of the {name}, °C")
axes[0].set_ylabel("zero of X, µg")
axes[0].legend()
fig.tight_layout()
print(f"lag of the element behind the case: {lag.tau_s:.1f} s, effect of their difference {lag.per_k:+.2f} ug/K")

# %% [markdown]
# ## The numbers of a passport
#
# At 30 °C, by both methods. U holds what is known of the measuring chain, which is most of it here: for the shape of
# the curve the chain's constant zero does not matter, and its lines can be left out.

# %%
print("                    soak                  sweep")
for name in ("zero_x_ug", "zero_y_ug", "zero_z_ug", "scale_x_v_per_g"):
    by_soak, by_sweep = (next(e for e in result.estimates[m.name] if e.name == name) for m in result.methods)
    digits = 1 if "ug" in name else 6
    texts = [f"{e.value:9.{digits}f} +- {e.ci_half:.{digits}f}" for e in (by_soak, by_sweep)]
    print(f"{name:16} {texts[0]:>20}  {texts[1]:>20} {by_soak.unit}")
budget = sorted(result.estimates["soak"][0].budget, key=lambda c: -c.u)
print(f"budget of {QUANTITY}: " + ", ".join(f"{c.name} {c.u:.2f}" for c in budget if c.u > 0.1) + " ug")

# %% [markdown]
# ## What is compensated
#
# Largest minus smallest zero over the range before, and the rms of what the polynomial leaves.

# %%
for method in result.methods:
    for axis in "xyz":
        fit = method.fits[f"zero_{axis}_ug"].best
        change = np.ptp(method.points.quantity(f"zero_{axis}_ug"))
        print(f"{method.title:20} {axis}: {change:6.1f} ug over the range, {fit.rms:5.2f} ug left, degree {fit.degree}")

# %% [markdown]
# ## Truth
#
# Only an emulator has it: the sensors' true outputs in the soak. No part of the procedure has read them.

# %%
report = graded_report(result, read_truth(run.folder, result.recordings), run.facts)
table = graded_table(report, "soak")
print("\n".join(aligned([table[0], *(row for row in table[1:] if row[0].startswith("zero"))])))
print(f"{sum(bool(g.within) for g in report.graded)} of {len(report.graded)} values are within 2 U")
stack.close()
