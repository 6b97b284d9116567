# %% [markdown]
# # Calibration of a strapdown unit, and a flight
#
# An inertial unit of three gyros and three accelerometers is on a rate table. Turned about each of its axes, it shows
# the errors of all six sensors at once ([the method](../../docs/procedures/sins_calibration.md)). Then: what does the
# calibration do for an hour of flight without any other help?

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from psabench.native import nav_errors
from psabench.native.kalman import Kalman
from psabench.native.sins import state_layout
from psabench.procedures.head_bench import Silent
from psabench.sins.alignment import aligned_state
from psabench.sins.calibration_params import SinsOptions
from psabench.sins.calibration_run import run_calibration
from psabench.sins.flight import Flight, fly_steps, rest_state
from psabench.sins.parameters import SCALES, state_parameters
from psabench.sins.snake import SHOWN_S, STEP_S, error_model, rho_along, start_of

with TemporaryDirectory() as folder:
    options = SinsOptions(out=Path(folder), seed=4, params={"plan": "../sins/short_plan.yaml"})
    run = run_calibration(options, Silent())
result = run.result
print(f"{run.facts['recorded']} on the table; doubts: {len(result.doubts)}")
print("\n".join(run.advice))

# %% [markdown]
# ## What it found
#
# ν are the zeros of the gyros, Θ their scale factors and axes, Δf and Γ the same of the accelerometers. ± is the half
# width of the 95 % interval.

# %%
for p in result.parameters:
    if p.name[-1] == p.name[-2] or p.name.startswith(("nu", "df")):
        print(f"{p.symbol:4} {p.value:10.2f} +- {p.half95:7.2f} {p.unit:6} (before: +- {2 * p.prior_sd:.0f})")

# %% [markdown]
# ## An hour of flight
#
# The unit is aligned at rest and flies autonomously for an hour, level, its heading swinging by ±30°. The covariance
# of what is left of the sensors' errors goes through the linear equations of the navigation errors; the alignment
# errs by the same sensors. "Before" are the errors that a unit of its class may have, "after" is the covariance of
# this calibration.

# %%
sensors = [k for k, p in enumerate(result.parameters) if p.name.startswith(("nu", "theta", "df", "gamma"))]
keys = {name: key for name, key, _ in state_parameters(state_layout(result.cfg), result.cfg)}
per_si = np.array([SCALES[keys[result.parameters[k].name]].per_si for k in sensors])
after = result.covariance[np.ix_(sensors, sensors)] / np.outer(per_si, per_si)
before = np.diag([result.parameters[k].prior_sd ** 2 for k in sensors]) / np.outer(per_si, per_si)

ALIGNMENT_S = 600.0
flight = Flight()
model = error_model(result.cfg)
way = fly_steps(flight, STEP_S).way()
rho_m = {
    name: np.array(list(rho_along(model, way, start_of(model, flight, p, ALIGNMENT_S))))
    for name, p in (("before", before), ("after", after))
}
minutes = SHOWN_S / 60 * np.arange(len(rho_m["after"]))
fig, ax = plt.subplots(figsize=(8, 3.5))
for name, rho in rho_m.items():
    ax.semilogy(minutes[1:], rho[1:] / 1e3, label=f"{name} the calibration")
ax.set_xlabel("time of flight, min")
ax.set_ylabel("horizontal error, rms, km")
ax.legend()
ax.grid(which="both", alpha=0.3)
fig.tight_layout()
for name, rho in rho_m.items():
    print(f"{name:6} {rho[-1] / 1e3:8.2f} km after an hour (rms of units like this one)")

# %% [markdown]
# ## Truth
#
# Only an emulator has it: the true parameters, in the same frame. All errors together are judged by their chi-square,
# which knows their correlations. Then what is left of this unit's errors flies the same hour.

# %%
graded = run.graded
assert graded is not None
half95 = np.array([result.parameters[k].half95 for k in sensors])
print(f"{(np.abs(graded.error) <= half95).sum()} of {len(graded.error)} errors are within their 95 % interval")
print(f"chi-square {graded.chi_square:.1f} of {len(graded.error)}, p = {graded.p:.2f}")
x, start = aligned_state(model, rest_state(flight), graded.error / per_si, after, ALIGNMENT_S)
errors = Kalman(x, start, 7)
nav_errors.predict_errors(model, errors, way)
off_km = np.hypot(errors.x[0], errors.x[1]) / 1e3
print(f"this unit is {off_km:.2f} km off after the hour; predicted rms {rho_m['after'][-1] / 1e3:.2f} km")
