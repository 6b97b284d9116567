"""Gyrocompassing: heading and drifts from levelling rates in several positions, eqs (7)-(19) corrected.

`measure` turns the platform from position to position and keeps a window in each; `estimate` is pure. The derivations,
the errata and what the article's figures are worth: docs/procedures/gyrocompass.md. The algebra is libpsabench-nav's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from psabench import nav
from psabench.errors import BadInput, LinkError
from psabench.estimate.uncertainty import Estimate
from psabench.nav import ARCMIN, DEGPH, EARTH_RADPS, Flag, Method
from psabench.procedures.head_bench import Progress
from psabench.procedures.platform_bench import STEP_S, Floats, PlatformBench, Table, Window
from psabench.procedures.result import DEG, option

NAME = "gyrocompass"
SUMMARY = "a gyro platform finds north and its drifts from several positions, the article's way and a better one"

METHODS: Mapping[str, Method] = {
    "closed3": Method.CLOSED3,
    "lsq": Method.LSQ,
    "constrained": Method.CONSTRAINED,
    "gls": Method.GLS,
    "gls-constrained": Method.GLS_CONSTRAINED,
}
ANGLES = ("set", "encoder")
SIGNALS = ("frames", "readings")
Z95 = 1.96
LEVEL_LIMIT_S = 60.0  # patience for levelling
RESIDUAL_LIMIT = 4.0  # residuals may be so many times what noise and drift explain
RATE_STEP = 1e-3 * DEGPH  # resolution of a rate on the wire, generously
OFF_LIMIT_RAD = math.radians(1.0)  # encoder against the angle asked for: beyond it the sensor tells nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class GyrocompassParams:
    """Parameters of `gyrocompass`; the defaults are the article's reading, READINGS has the others."""

    sequence: str = option("0,90,180", "deg", "gimbal angles in the order of measurement, 32 at most")
    repeat: int = option(1, "", "times over")
    window_s: float = option(10.0, "s", "measurement in each position")
    settle_s: float = option(10.0, "s", "from the end of a turn to its window")
    slew_dps: float = option(9.0, "deg/s", "rate of the turns")
    m1_per_s: float = option(1.0, "1/s", "levelling loop")
    m2_per_s: float = option(2.0, "1/s", "azimuth loop")
    freeze: bool = option(False, "", "no azimuth servo in the windows")
    latitude_deg: float = option(50.0, "deg", "as the operator gives it")
    method: str = option("closed3", "", f"one of {', '.join(METHODS)}")
    angles: str = option("set", "", "which angle is trusted: set or encoder")
    cardan: bool = option(True, "", "correct the angles for the tilt of the outer axis")
    simplified: bool = option(True, "", "eq. (14) instead of (13)")
    slope: bool = option(False, "", "the levelling rate as a slope instead of a mean")
    signals: str = option(
        "frames", "", "level angles from the frames of the level unit, or from the readings of the gyro unit"
    )
    calibrate_s: float = option(60.0, "s", "window of the azimuth axis after the run; 0: none")
    gm_sigma_degph: float = option(0.2, "deg/h", "random drift, from the passport")
    gm_tau_s: float = option(1000.0, "s", "its correlation time")
    angle_sd_arcmin: float = option(3.0, "arcmin", "error of an angle, new in each position")
    level_sd_arcmin: float = option(1.0, "arcmin", "error of the level angles, new in each position")
    level_zero_arcmin: float = option(10.0, "arcmin", "their constant error, for the drift's limits")
    angle_zero_arcmin: float = option(
        6.0, "arcmin", "of the angle sensor against the vehicle, for the heading's limits"
    )
    torquer_scale: float = option(1e-3, "", "error of the torquers, for the drift's limits")

    def __post_init__(self) -> None:
        for name, known in (("method", tuple(METHODS)), ("angles", ANGLES), ("signals", SIGNALS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} is {getattr(self, name)!r}; it must be one of {', '.join(known)}")
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, float) and f.name != "latitude_deg" and not 0.0 <= value < math.inf:
                raise ValueError(f"{f.name} is {value}; it must not be negative")
        if self.window_s < 10 * STEP_S or self.repeat < 1:
            raise ValueError(f"window_s is {self.window_s}, repeat {self.repeat}; at least {10 * STEP_S:g} and 1")
        rehearse(self)

    @property
    def angles_deg(self) -> tuple[float, ...]:
        """`sequence` as numbers."""
        try:
            found = tuple(float(x) for x in self.sequence.split(","))
        except ValueError:
            raise ValueError(f"sequence is {self.sequence!r}; it must be angles in degrees, as 0,90,180") from None
        if not all(abs(a) <= 360.0 for a in found):
            raise ValueError(f"sequence is {self.sequence!r}; each must lie within +-360 deg")
        return found

    @property
    def latitude_rad(self) -> float:
        return math.radians(self.latitude_deg)

    @property
    def table(self) -> Table:
        return Table(
            angles_deg=self.angles_deg,
            repeat=self.repeat,
            window_s=self.window_s,
            settle_s=self.settle_s,
            slew_dps=self.slew_dps,
            freeze=self.freeze,
        )


# The article's reading: set angles trusted, closed form, (14). Ours: fast reversals, encoder read, (13), weights.
READINGS: Mapping[str, Mapping[str, Any]] = {
    "article": {},
    "improved": {
        "sequence": "0,180,90,270",
        "repeat": 6,
        "window_s": 5.0,
        "settle_s": 5.0,
        "slew_dps": 18.0,
        "m1_per_s": 2.0,
        "method": "gls-constrained",
        "angles": "encoder",
        "simplified": False,
        "angle_sd_arcmin": 0.5,
    },
}


def params_of(reading: str, given: Mapping[str, Any] | None = None) -> GyrocompassParams:
    """The parameters of a reading, with those given in their place. Raises BadInput."""
    if reading not in READINGS:
        raise BadInput(f"reading is {reading!r}; it must be one of {', '.join(READINGS)}")
    try:
        return GyrocompassParams(**{**READINGS[reading], **(given or {})})
    except ValueError as e:
        raise BadInput(f"{NAME}: {e}") from e


def rehearse(p: GyrocompassParams) -> None:
    """Whether these positions can tell a heading at all, before anything moves. Raises BadInput with the reason."""
    angles = np.radians(Table(angles_deg=p.angles_deg, repeat=p.repeat).sequence_deg)
    if not abs(p.latitude_deg) <= 90.0:
        raise BadInput(f"{NAME}: latitude_deg is {p.latitude_deg:g}; it must lie within +-90")
    we = EARTH_RADPS * math.cos(p.latitude_rad)
    pace_s = p.window_s + p.settle_s
    rows = [
        nav.Position(s_radps=we * math.sin(a), delta_rad=a - angles[0], t_mid_s=k * pace_s, window_s=p.window_s)
        for k, a in enumerate(angles)
    ]
    nav.gyrocompass(rows, latitude_rad=p.latitude_rad, method=METHODS[p.method], noise=_noise(p, 0.0))


# ---- the run


def measure(
    bench: PlatformBench, p: GyrocompassParams, progress: Progress, *, seen: Callable[[], None] = lambda: None
) -> tuple[Window, ...]:
    """Level, go through the positions, calibrate: the last window is the calibration's if there is one.

    seen: called soon after the end of each window of the run. Raises LinkError where the platform does not do it.
    """
    bench.prepare(latitude_rad=p.latitude_rad, m1_per_s=p.m1_per_s, m2_per_s=p.m2_per_s)
    with progress.step("levelling", 1) as done:
        bench.level(LEVEL_LIMIT_S)
        done()
    table = p.table
    with progress.step("gyrocompassing", len(table.sequence_deg)) as done:

        def over() -> None:
            seen()
            done()

        windows = tuple(bench.measure(table, over))
    if p.calibrate_s:
        with progress.step("calibrating the azimuth axis", 1) as done:
            windows += (bench.calibrate(p.calibrate_s, p.settle_s),)
            done()
    return windows


# ---- from windows to numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A position as it enters the equations."""

    number: int
    q_rad: float  # the angle that was trusted
    position: nav.Position
    residual_radps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GyrocompassResult:
    """Estimates with their confidence, and everything a report shows."""

    params: GyrocompassParams
    windows: tuple[Window, ...]  # all, with the calibration's last
    rows: tuple[Row, ...]  # of the windows that count
    compass: nav.Compass
    attitude: nav.Attitude
    heading_rad: float
    drift2_radps: float
    estimates: tuple[Estimate, ...]
    doubts: tuple[str, ...]  # reasons not to trust the heading
    notes: tuple[str, ...]

    def get(self, name: str) -> Estimate:
        """The estimate of that name; raises KeyError with the names there are."""
        for e in self.estimates:
            if e.name == name:
                return e
        raise KeyError(f"{name}; there are {', '.join(e.name for e in self.estimates)}")

    @property
    def duration_s(self) -> float:
        """From the first window to the last of the run."""
        run = self.windows[: len(self.params.table.sequence_deg)]
        return run[-1].t_mid_s - run[0].t_mid_s + run[-1].length_s


def _noise(p: GyrocompassParams, window_sd_radps: float) -> nav.Noise:
    return nav.Noise(
        gm_sigma_radps=p.gm_sigma_degph * DEGPH,
        gm_tau_s=max(p.gm_tau_s, STEP_S),
        window_sd_radps=window_sd_radps,
        angle_sd_rad=p.angle_sd_arcmin * ARCMIN,
        level_sd_rad=p.level_sd_arcmin * ARCMIN,
    )


def s_of(w: Window, *, slope: bool, frozen: bool) -> float:
    """Levelling rate of a window, rad/s: the mean of -m1 beta, or the slope of beta less its integral.

    With the azimuth servo off the platform turns by what the encoder tells, and levelling takes it for a rate: (3).
    """
    s = w.levelling_radps
    rate = nav.window_slope(w.beta_rad, s, STEP_S) if slope else float(s.mean())
    if frozen and len(s) > 1:
        turn_radps = _slope(np.unwrap(w.encoder_rad))
        rate += turn_radps * math.sin(float(w.gamma_rad.mean()))
    return rate


def _slope(x: Floats) -> float:
    """Of a straight line through values a step apart, per second."""
    t = (np.arange(len(x)) - (len(x) - 1) / 2.0) * STEP_S
    return float(t @ x / (t @ t))


def _s_sd(windows: Sequence[Window], slope: bool) -> float:
    """Standard deviation of S from the noise that the level angles show from step to step, rad/s.

    White noise n of a step leaves n sqrt(m1 dt)/T in the mean of the closed loop, n sqrt(12/N)/T in the slope.
    """
    of = []
    for w in windows:
        n = float(np.std(np.diff(w.beta_rad)) / math.sqrt(2.0)) if len(w.beta_rad) > 2 else 0.0
        of.append(n * math.sqrt(12.0 / len(w.beta_rad) if slope else w.m1_per_s * STEP_S) / w.length_s)
    return float(np.mean(of))


def _trusted(w: Window, p: GyrocompassParams) -> float:
    """The gimbal angle of a window, rad."""
    if p.angles == "set":
        return w.set_rad
    return w.set_rad + _wrapped(float(np.unwrap(w.encoder_rad).mean()) - w.set_rad)


def _wrapped(angle_rad: float) -> float:
    """Into (-pi, pi]."""
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


def _off(w: Window) -> str:
    """Why the encoder of a window contradicts the angle that was asked for, "": it does not."""
    off_rad = _wrapped(float(np.unwrap(w.encoder_rad).mean()) - w.set_rad)
    if abs(off_rad) <= OFF_LIMIT_RAD:
        return ""
    shown, asked = (w.set_rad + off_rad) * DEG, w.set_rad * DEG
    return f"the encoder shows {shown:.2f} deg, not {asked:g}: it is stuck, or the platform did not turn"


def _sorted_out(windows: Sequence[Window]) -> tuple[list[Window], list[str]]:
    """The windows that count, and a sentence for each of the others."""
    good, notes = [], []
    for w in windows:
        why = [*w.faults, *([_off(w)] if _off(w) else [])]
        if why:
            notes.append(f"position {w.number + 1} ({w.set_rad * DEG:g} deg) does not count: {'; '.join(why)}")
        else:
            good.append(w)
    return good, notes


def _attitude(q_rad: Floats, windows: Sequence[Window]) -> nav.Attitude:
    """Of the vehicle, with the constant error of gamma where the positions tell it."""
    beta = np.array([w.beta_rad.mean() for w in windows])
    gamma = np.array([w.gamma_rad.mean() for w in windows])
    return nav.attitude_from_level(q_rad, gamma, beta, bias=True)


def estimate(windows: Sequence[Window], p: GyrocompassParams) -> GyrocompassResult:
    """Pure. Raises LinkError when too few windows are good, with what was wrong with the others."""
    run = windows[: len(p.table.sequence_deg)]
    good, notes = _sorted_out(run)
    q = np.array([_trusted(w, p) for w in good])
    try:
        attitude = _attitude(q, good)
        delta = _increments(q, good, attitude, p)
        rows, noise = _positions(good, q, delta, attitude, p)
        compass = nav.gyrocompass(
            rows, latitude_rad=p.latitude_rad, method=METHODS[p.method], simplified=p.simplified, noise=noise
        )
    except nav.Refused as e:
        why = "; ".join(notes) or "all windows are good"
        raise LinkError(f"{NAME}: no heading from {len(good)} of {len(run)} windows: {e} ({why})") from e
    psi = nav.heading(
        compass.alpha1_rad,
        float(q[0]),
        beta_rad=rows[0].beta_rad if p.cardan else 0.0,
        pitch_rad=attitude.pitch_rad if p.cardan else 0.0,
        roll_rad=attitude.roll_rad if p.cardan else 0.0,
    )
    kept = tuple(
        Row(number=w.number, q_rad=float(a), position=r, residual_radps=_residual(r, compass, p))
        for w, a, r in zip(good, q, rows, strict=True)
    )
    drift2, drift2_sd = _drift2([*good, *_good_calibration(windows, p)], kept, compass, attitude, p)
    return GyrocompassResult(
        params=p,
        windows=tuple(windows),
        rows=kept,
        compass=compass,
        attitude=attitude,
        heading_rad=psi,
        drift2_radps=drift2,
        estimates=_estimates(compass, attitude, psi, drift2, drift2_sd, p),
        doubts=_doubts(compass, kept, noise, p),
        notes=(*notes, *_notes(compass, windows, p)),
    )


def _increments(q: Floats, windows: Sequence[Window], attitude: nav.Attitude, p: GyrocompassParams) -> Floats:
    if not p.cardan:
        return np.asarray(q - q[0])
    beta = np.array([w.beta_rad.mean() for w in windows])
    return nav.cardan(q, pitch_rad=attitude.pitch_rad, roll_rad=attitude.roll_rad, beta_rad=beta)


def _positions(
    windows: Sequence[Window], q: Floats, delta: Floats, attitude: nav.Attitude, p: GyrocompassParams
) -> tuple[list[nav.Position], nav.Noise]:
    bias = 0.0 if p.simplified else attitude.gamma_bias_rad
    rows = [
        nav.Position(
            s_radps=s_of(w, slope=p.slope, frozen=p.freeze),
            delta_rad=float(d),
            beta_rad=float(w.beta_rad.mean()),
            gamma_rad=float(w.gamma_rad.mean()) - bias,
            t_mid_s=w.t_mid_s,
            window_s=w.length_s,
        )
        for w, d in zip(windows, delta, strict=True)
    ]
    return rows, _noise(p, _s_sd(windows, p.slope))


def _residual(r: nav.Position, c: nav.Compass, p: GyrocompassParams) -> float:
    """What a window's rate misses the model by, rad/s."""
    we = EARTH_RADPS * math.cos(p.latitude_rad)
    a = c.alpha1_rad + r.delta_rad
    tilt = 0.0 if p.simplified else math.sin(r.gamma_rad) * math.sin(r.beta_rad)
    return r.s_radps - we * (math.sin(a) * math.cos(r.gamma_rad) + math.cos(a) * tilt) - c.drift1_radps


# ---- the azimuth axis


def _good_calibration(windows: Sequence[Window], p: GyrocompassParams) -> list[Window]:
    return [w for w in windows[len(p.table.sequence_deg) :] if not w.faults]


def _drift2(
    windows: Sequence[Window],
    rows: Sequence[Row],
    compass: nav.Compass,
    attitude: nav.Attitude,
    p: GyrocompassParams,
) -> tuple[float, float]:
    """Drift of the azimuth axis from its torquer, rad/s, and its standard deviation against the mean drift.

    Mean over all windows, weighed by their lengths.
    """
    found, weight = [], []
    for k, w in enumerate(windows):
        delta = rows[k].position.delta_rad if k < len(rows) else _delta_at(w, rows[0], attitude, p)
        alpha = compass.alpha1_rad + delta
        found.append(
            nav.azimuth_drift(
                float(w.u2_radps.mean()),
                latitude_rad=p.latitude_rad,
                alpha_rad=alpha,
                beta_rad=float(w.beta_rad.mean()),
                gamma_rad=float(w.gamma_rad.mean()) - attitude.gamma_bias_rad,
            )
        )
        weight.append(w.length_s)
    value = float(np.average(found, weights=weight))
    level = nav.azimuth_drift_sd(
        latitude_rad=p.latitude_rad,
        alpha_rad=compass.alpha1_rad + math.pi / 4.0,
        beta_sd_rad=p.level_sd_arcmin * ARCMIN,
        gamma_sd_rad=p.level_sd_arcmin * ARCMIN,
    )
    return value, math.hypot(p.gm_sigma_degph * DEGPH, level / math.sqrt(len(found)))


def _delta_at(w: Window, first: Row, attitude: nav.Attitude, p: GyrocompassParams) -> float:
    """Increment of alpha of a window outside the run."""
    q = np.array([first.q_rad, _trusted(w, p)])
    return float(_increments(q, [w, w], attitude, p)[1])


# ---- what is reported


def _estimates(
    c: nav.Compass, attitude: nav.Attitude, psi: float, drift2: float, drift2_sd: float, p: GyrocompassParams
) -> tuple[Estimate, ...]:
    tilt_sd = p.level_sd_arcmin * ARCMIN
    return (
        _estimate("heading_deg", "ψ", "deg", psi * DEG, c.alpha1_sd_rad * DEG),
        _estimate("alpha1_deg", "α_1", "deg", c.alpha1_rad * DEG, c.platform_sd_rad * DEG),
        _estimate("drift1_degph", "ω_d1", "deg/h", c.drift1_radps / DEGPH, c.drift1_sd_radps / DEGPH),
        _estimate("drift2_degph", "ω_d2", "deg/h", drift2 / DEGPH, drift2_sd / DEGPH),
        _estimate("pitch_deg", "ϑ", "deg", attitude.pitch_rad * DEG, tilt_sd * DEG),
        _estimate("roll_deg", "γ", "deg", attitude.roll_rad * DEG, tilt_sd * DEG),
    )


def _estimate(name: str, symbol: str, unit: str, value: float, sd: float) -> Estimate:
    return Estimate(name=name, symbol=symbol, unit=unit, value=value, sd=sd, ci_half=Z95 * sd)


def allowance(result: GyrocompassResult) -> dict[str, float]:
    """What the constant errors of the instrument may add to each estimate, in its unit: no window sees them."""
    p, c = result.params, result.compass
    level = p.level_zero_arcmin * ARCMIN
    we, wz = EARTH_RADPS * math.cos(p.latitude_rad), EARTH_RADPS * abs(math.sin(p.latitude_rad))
    zero_deg = p.angle_zero_arcmin / 60.0
    return {
        "heading_deg": zero_deg + level * math.tan(math.radians(5.0)) * DEG,
        "alpha1_deg": level * math.tan(math.radians(5.0)) * DEG,
        "drift1_degph": wz * level / DEGPH + p.torquer_scale * abs(c.drift1_radps) / DEGPH,
        "drift2_degph": math.sqrt(2.0) * we * level / DEGPH + p.torquer_scale * abs(result.drift2_radps) / DEGPH,
        "pitch_deg": p.level_zero_arcmin / 60.0 * 2.0,
        "roll_deg": p.level_zero_arcmin / 60.0 * 2.0,
    }


def _doubts(c: nav.Compass, rows: Sequence[Row], noise: nav.Noise, p: GyrocompassParams) -> tuple[str, ...]:
    """Reasons not to trust the heading."""
    found = []
    if Flag.POOR_QUALITY in c.flags:
        seen = math.hypot(c.s, c.c)
        cosine = seen * math.cos(p.latitude_rad)
        would = (
            f"it would be right at latitude {math.degrees(math.acos(cosine)):.2f} deg"
            if cosine <= 1.0
            else "no latitude fits"
        )
        found.append(
            f"the horizontal Earth rate found is {seen:.4f} of U cos({p.latitude_deg:g} deg): {would}, "
            "or rates of different windows do not belong together"
        )
    left = float(np.sqrt(np.mean([r.residual_radps**2 for r in rows])))
    angle = EARTH_RADPS * math.cos(p.latitude_rad) * noise.angle_sd_rad
    expected = math.hypot(noise.gm_sigma_radps, noise.window_sd_radps, angle, EARTH_RADPS * noise.level_sd_rad)
    if len(rows) > 3 and left > RESIDUAL_LIMIT * expected + RATE_STEP:
        found.append(
            f"the rates miss the model by {left / DEGPH:.3g} deg/h rms where {expected / DEGPH:.2g} is expected: "
            "the drift jumped, the vehicle moved, or an angle is wrong"
        )
    if Flag.NOT_CONVERGED in c.flags:
        found.append("the constrained fit did not converge")
    return tuple(found)


def _notes(c: nav.Compass, windows: Sequence[Window], p: GyrocompassParams) -> list[str]:
    said = Flag.POOR_QUALITY | Flag.NOT_CONVERGED | Flag.SIMPLIFIED
    raised = [f for f in Flag if f in c.flags]
    notes = [text for f, text in zip(raised, c.warnings, strict=True) if f not in said]
    if p.calibrate_s and not _good_calibration(windows, p):
        notes.append(f"the calibration does not count: {'; '.join(windows[-1].faults)}")
    return notes
