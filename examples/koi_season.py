"""What a season of flights teaches a unit's passport: two drifts and a zero of an accelerometer, a flight a week."""

import tempfile
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from psabench.koi.autocal import FlightEstimate, InstrumentClass, filter_prior, knowledge_after
from psabench.koi.flight_log import begin_flight, end_flight, read_log
from psabench.passport.store import PassportStore

DEGPH = np.pi / 180 / 3600
UNIT = np.array([DEGPH, DEGPH, 1.0])  # printed in deg/h, deg/h, m/s2
KIND = InstrumentClass(
    names=("nu1_radps", "nu2_radps", "df1_mps2"),
    persistent_sd=np.array([0.02, 0.02, 1.5e-3]) * UNIT,
    run_sd=np.array([0.01, 0.01, 5e-4]) * UNIT,
    aging_sd=np.zeros(3),
)
FOUND_SD = np.array([0.004, 0.004, 7e-4]) * UNIT  # of a flight by itself
BEGIN = datetime(2026, 5, 1, 6, 30, tzinfo=UTC)


def fly(
    rng: np.random.Generator, total: np.ndarray, p: np.ndarray, prior: np.ndarray, begun: datetime
) -> FlightEstimate:
    """Replaces a flight: its filter begins with this prior and sees each error with noise."""
    variance = np.diag(prior)
    gain = variance / (variance + FOUND_SD**2)
    beyond = gain * (total - p + FOUND_SD * rng.standard_normal(3))
    after = np.diag((1 - gain) * variance)
    return FlightEstimate(serial="S7", names=KIND.names, time_s=begun.timestamp(), x=p + beyond, covariance=after)


rng = np.random.default_rng(4)
persistent = KIND.persistent_sd * rng.standard_normal(3)
with tempfile.TemporaryDirectory() as folder, PassportStore(Path(folder) / "units.sqlite") as store:
    for week in range(8):
        begun = BEGIN + timedelta(weeks=week)
        key = begin_flight(store, "S7", "sins", begun)
        known = knowledge_after(KIND, "S7", read_log(store, "S7").events)
        p, prior = filter_prior(known, KIND, begun.timestamp())  # corrects the sensors; the filter begins with it
        total = persistent + KIND.run_sd * rng.standard_normal(3)
        end_flight(store, "sins", key, fly(rng, total, p, prior, begun))
        left = (persistent - p) / UNIT
        print(f"flight {week + 1}: not corrected {left[0]:+.4f} {left[1]:+.4f} deg/h {left[2]:+.5f} m/s2")
    known = knowledge_after(KIND, "S7", read_log(store, "S7").events)
    off, sd = (persistent - known.p) / UNIT, np.sqrt(np.diag(known.covariance)) / UNIT
    print(f"nu1 is known to {sd[0]:.4f} deg/h, and is off by {off[0]:+.4f}")
