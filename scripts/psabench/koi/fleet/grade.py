"""A flight of the host beside the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from psabench.koi.autocal import Knowledge
from psabench.koi.fleet.receiver import place_rows, states_at
from psabench.koi.fleet.routes import HOUR_S, Journey
from psabench.koi.fleet.unit import Errors, Readings
from psabench.koi.flight_data import FlightFound
from psabench.koi.geodesy import offset_m
from psabench.link.signals import Floats
from psabench.native.flight_model import States
from psabench.native.nav import ARCMIN, DEGPH
from psabench.native.strapdown import radii_m

MINUTES = 60  # of an error curve, from take-off
TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
# Words of a reason why a unit did not correct itself, for counting: psabench.koi.trust, take_off, host.
REASONS: Mapping[str, str] = {
    "no measurement lately": "a measurement in the last",
    "few measurements": "measurements of",
    "outside the gate": "outside its gate",
    "innovations": "innovations of",
    "estimates beyond the prior": "standard deviations of their priors",
    "heading not found": "a heading known to",
    "no turns or stops": "during the taxi",
    "doubt": "alignment",
}
# Of a flight; a row of the store has them for each flight, and then the curves.
SCALARS = (
    "max_n_m",
    "max_e_m",
    "heading_sd_aligned_arcmin",
    "level_sd_aligned_arcmin",
    "heading_sd_arcmin",  # at take-off, as the next two
    "level_sd_arcmin",
    "heading_error_arcmin",  # of the autonomous solution, just after
    "nees",  # of the filter at the end of the flight
    "nees_dof",
    "nees_within",  # the same without place and delays, which slow errors of the receiver go into
    "nees_within_dof",
    "corrected",
    "weight",
    "estimate_take_off",  # rms of what is corrected of attitude and sensors, by the prior's standard deviations
    "estimate_end",  # the same at the end of the flight; both not a number without a correction
    "reasons",  # a bit for each of REASONS
    "left_nu12_degph",  # of the persistent errors, what the passport does not know after the flight
    "left_nu3_degph",
    "left_df12_mps2",
    "left_df3_mps2",
)
CURVES = tuple(f"{axis} {k} min" for axis in "ne" for k in range(MINUTES + 1))
COLUMNS = SCALARS + CURVES


@dataclass(frozen=True, slots=True, kw_only=True)
class Against:
    """What a flight is compared with."""

    journey: Journey
    readings: Readings
    delays_s: tuple[float, float]
    stays: Errors


def grade_flight(found: FlightFound, truth: Against, known: Knowledge | None) -> Floats:
    """As COLUMNS. known: of the unit after the flight; None: it learns nothing."""
    errors = place_errors(found, truth.journey)
    hour = in_hour(found.t_s, truth.journey)
    off = state_errors(found, truth)
    scalars = {
        "max_n_m": np.abs(errors[hour, 0]).max(),
        "max_e_m": np.abs(errors[hour, 1]).max(),
        **_attitude_numbers(found, truth),
        **_nees_numbers(found, off),
        "corrected": float(found.corrected),
        "weight": found.estimate.weight,
        **_estimate_numbers(found),
        "reasons": float(reason_bits(found)),
        **_left_numbers(known, truth.stays),
    }
    curves = minute_rows(found.t_s, errors, truth.journey)
    return np.concatenate([[scalars[name] for name in SCALARS], curves.T.ravel()])


def minute_rows(t_s: Floats, rows: Floats, j: Journey) -> Floats:
    """Rows of each minute from take-off; not a number after the end of a flight that is shorter than an hour."""
    at = np.searchsorted(t_s, j.take_off_s + 60.0 * np.arange(MINUTES + 1.0))
    return np.where((at < len(t_s))[:, None], rows[np.minimum(at, len(t_s) - 1)], np.nan)


def place_errors(found: FlightFound, j: Journey) -> Floats:
    """Of the autonomous solution, north and east, m: (m, 2)."""
    true = states_at(j, found.t_s)
    return offset_m(found.autonomous[:, :3], place_rows(true))[:, [1, 0]]


def in_hour(t_s: Floats, j: Journey) -> np.ndarray:
    """Which seconds are in the hour from take-off."""
    return (t_s >= j.take_off_s) & (t_s <= j.take_off_s + HOUR_S)


def state_errors(found: FlightFound, truth: Against) -> Floats:
    """Of the filter's estimates at the end of the flight, (n,)."""
    true_x = np.zeros(len(found.names))
    end_s = float(found.t_s[-1])
    true_x[:9] = moving_errors(found.autonomous[-1], states_at(truth.journey, np.array([end_s])))
    off = found.x - true_x
    sensors = slice(found.names.index("nu1_radps"), len(found.names) - 2)
    off[sensors] = found.estimate.x - truth.readings.errors_at(round(end_s))
    off[-2:] = found.x[-2:] - truth.delays_s
    return np.asarray(off)


# The altimeter moves these after the solutions of the last second are written down.
VERTICAL = ("dr3", "dV3", "baro")
OF_RECEIVER = ("dr1", "dr2", "dt1", "dt2")


def _nees_numbers(found: FlightFound, off: Floats) -> dict[str, float]:
    numbers = {}
    for name, without in (("nees", VERTICAL), ("nees_within", VERTICAL + OF_RECEIVER)):
        kept = np.array([state not in without for state in found.names])
        numbers[name] = normalised_square(off[kept], found.p[np.ix_(kept, kept)])
        numbers[f"{name}_dof"] = float(kept.sum())
    return numbers


def normalised_square(off: Floats, p: Floats) -> float:
    """x' P^-1 x, scaled: variances differ by orders."""
    sd = np.sqrt(np.diag(p))
    return float(off / sd @ np.linalg.solve(p / np.outer(sd, sd), off / sd))


def moving_errors(row: Floats, true: States) -> Floats:
    """The nine moving states of koi.h that a solution (15,) has, by the truth at one instant."""
    lat_rad = float(true.lat_rad[0])
    dr = offset_m(row[None, :3], place_rows(true))[0]
    dv = row[3:6] - true.v_enu_mps[0]
    beta = Rotation.from_matrix(row[6:].reshape(3, 3) @ (TO_ENU @ true.C_nb[0]).T).as_rotvec()
    east, north = row[3] * beta[2], row[4] * beta[2]
    beta3 = beta[2] + math.tan(lat_rad) / radii_m(lat_rad, float(true.h_m[0]))[1] * dr[0]
    return np.array([dr[0], dr[1], dv[0] + north, dv[1] - east, beta[0], beta[1], beta3, dr[2], dv[2]])


def reason_bits(found: FlightFound) -> int:
    """Why the unit did not correct itself."""
    texts = [] if found.decision is None else found.decision.reasons
    said = "; ".join((*texts, *(e.text for e in found.events if e.what == "doubt")))
    return sum(1 << k for k, words in enumerate(REASONS.values()) if words in said)


def _attitude_numbers(found: FlightFound, truth: Against) -> dict[str, float]:
    """Standard deviations of the filter, errors of the autonomous solution."""
    heading, level = found.names.index("beta3"), found.names.index("alpha1")
    up_s = truth.journey.take_off_s if found.take_off_s is None else found.take_off_s
    row = max(0, int(np.searchsorted(found.sd_t_s, up_s, side="right")) - 1)
    after = int(np.searchsorted(found.t_s, up_s + 1.0))
    true = states_at(truth.journey, found.t_s[after : after + 1])
    sd, first = found.sd[row] / ARCMIN, found.sd[0] / ARCMIN
    return {
        "heading_sd_aligned_arcmin": float(first[heading]),
        "level_sd_aligned_arcmin": float(first[level]),
        "heading_sd_arcmin": float(sd[heading]),
        "level_sd_arcmin": float(sd[level]),
        "heading_error_arcmin": float(moving_errors(found.autonomous[after], true)[6]) / ARCMIN,
    }


COMPENSATED = ("alpha", "beta3", "nu", "df", "gamma", "theta")


def _estimate_numbers(found: FlightFound) -> dict[str, float]:
    """Before and after, of the same states: the article's own evidence for the correction."""
    if not found.corrected or found.decision is None or found.x_take_off is None:
        return {"estimate_take_off": math.nan, "estimate_end": math.nan}
    taken = found.decision.take & np.array([name.startswith(COMPENSATED) for name in found.names])
    sizes = {"estimate_take_off": found.x_take_off, "estimate_end": found.x}
    return {name: float(np.sqrt(np.mean((x / found.sd[0])[taken] ** 2))) for name, x in sizes.items()}


def _left_numbers(known: Knowledge | None, stays: Errors) -> dict[str, float]:
    p = np.zeros(6) if known is None else known.p[:6]
    off = p - stays.vector()[:6]
    return {
        "left_nu12_degph": float(np.sqrt(np.mean(off[:2] ** 2))) / DEGPH,
        "left_nu3_degph": abs(float(off[2])) / DEGPH,
        "left_df12_mps2": float(np.sqrt(np.mean(off[3:5] ** 2))),
        "left_df3_mps2": abs(float(off[5])),
    }
