"""A gyro platform in memory, settled: rotation matrices and the precession equations written a second time.

It shares no line with the estimators or the emulator. What a window shows is the settled state of the loops, with what
a turn left of them, the noise and the errors that a test gives; drifts are whatever function of time the test wants.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from psabench.errors import LinkError
from psabench.procedures.platform_bench import Compensation, Look, Table, Window
from scipy.signal import lfilter

Array = npt.NDArray[np.float64]

STEP_S = 0.01  # of its controller
MIDDLES = (-0.4, -0.2, 0.0, 0.2, 0.4)  # of the fifths of a window
U_DEGPH = 15.041067
DEGPH = math.radians(1.0) / 3600.0
ARCMIN = math.radians(1.0 / 60.0)


def turn(axis: int, angle_rad: float) -> Array:
    """Active rotation about a coordinate axis."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    m = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m[i, i], m[i, j], m[j, i], m[j, j] = c, -s, s, c
    return m


@dataclass(kw_only=True)
class FakePlatform:
    """A `PlatformBench`. Angles in deg or arcmin as named, drifts in deg/h."""

    latitude_deg: float = 50.0
    heading_deg: float = 40.0
    pitch_deg: float = 5.0
    roll_deg: float = -4.0
    drift1_degph: Callable[[float], float] = lambda t_s: 25.0
    drift2_degph: Callable[[float], float] = lambda t_s: -12.0
    bias_beta_arcmin: float = 0.0  # measured less true
    bias_gamma_arcmin: float = 0.0
    scale1: float = 0.0  # error of the levelling torquer
    scale2: float = 0.0  # of the azimuth torquer
    angle_zero_arcmin: float = 0.0  # the angle sensor shows so much more
    noise_arcmin: float = 0.0  # of beta in each step; levelling follows it
    left_beta_arcmin: float = 0.0  # what each turn leaves of beta when it ends
    left_gimbal_arcmin: float = 0.0  # and of the gimbal angle
    vehicle_turns_deg: dict[int, float] = field(default_factory=dict)  # by window: the vehicle turns before it
    vehicle_tilts_deg: dict[int, float] = field(default_factory=dict)  # by window: its pitch changes before it
    set_sd_arcmin: float = 0.0
    read_sd_arcmin: float = 0.0
    level_sd_arcmin: float = 0.0
    stuck_deg: float | None = None  # what the encoder shows without end
    settles: bool = True
    broken: dict[int, dict[str, object]] = field(default_factory=dict)  # by window: fields that the wire would tell
    t_s: float = 0.0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(4))

    def __post_init__(self) -> None:
        self._q = math.radians(self.heading_deg) * 0.3
        self._set = 0.0
        self._told_rad = math.radians(self.latitude_deg)
        self._m1, self._m2, self._settle_s = 1.0, 2.0, 10.0
        self._idle = (0.0, 0.0, 0.0)  # until when, the rate then, what Earth and drifts took of the torquers' turns
        self._comp: Compensation | None = None
        self._alpha_hold = 0.0
        self._held_since_s = 0.0

    # ---- geometry

    def vehicle(self) -> Array:
        """Columns: x_c right, y_c ahead, z_c up, in east, north, up."""
        return (
            turn(2, -math.radians(self.heading_deg))
            @ turn(0, math.radians(self.pitch_deg))
            @ turn(1, math.radians(self.roll_deg))
        )

    def attitude(self, q_rad: float, beta_rad: float) -> tuple[float, float]:
        """(alpha, gamma) of the platform at a gimbal angle: x_p is across the outer axis."""
        c = self.vehicle()
        x = math.cos(q_rad) * c[:, 0] + math.sin(q_rad) * c[:, 1]
        gamma = -math.asin(x[2] / math.cos(beta_rad))
        alpha = math.atan2(x[1], x[0]) - math.atan2(math.sin(gamma) * math.sin(beta_rad), math.cos(gamma))
        r = turn(2, alpha) @ turn(0, beta_rad) @ turn(1, gamma)
        assert np.abs(r[:, 0] - x).max() < 1e-12
        return alpha, gamma

    def gimbal(self, alpha_rad: float, near_rad: float) -> float:
        """The gimbal angle of a levelled platform with this alpha, near another angle."""
        q = near_rad
        for _ in range(60):
            off = alpha_rad - self.attitude(q, 0.0)[0]
            q += (off + math.pi) % (2 * math.pi) - math.pi
        return q

    def earth_p(self, r: Array) -> Array:
        """The Earth's rate in the platform's axes, rad/s."""
        phi = math.radians(self.latitude_deg)
        return np.asarray(r.T @ np.array([0.0, math.cos(phi), math.sin(phi)]) * U_DEGPH * DEGPH)

    def settled(
        self, q_rad: float, length_s: float = 0.0, shift_arcmin: Sequence[float] | Array = (0.0, 0.0)
    ) -> tuple[float, float, float, float, float]:
        """(S, u1, u2, beta true, gamma true) of a platform that holds the gimbal still; rates in rad/s.

        length_s: of the window about this instant that they are means over. shift_arcmin: of gamma and beta, in this
        setting, beyond the constant errors of the level sensors.
        """
        beta = 0.0
        bias_gamma, bias_beta = self.bias_gamma_arcmin + shift_arcmin[0], self.bias_beta_arcmin + shift_arcmin[1]
        drift1, drift2 = (self._mean(d, length_s) * DEGPH for d in (self.drift1_degph, self.drift2_degph))
        wz = U_DEGPH * DEGPH * math.sin(self._told_rad)
        for _ in range(5):  # beta is some 1e-4: each round is that much nearer
            alpha, gamma = self.attitude(q_rad, beta)
            w = self.earth_p(turn(2, alpha) @ turn(0, beta) @ turn(1, gamma))
            u1 = (w[0] + drift1) / (1.0 + self.scale1)
            beta_n, gamma_n = beta + bias_beta * ARCMIN, gamma + bias_gamma * ARCMIN
            s = u1 + wz * math.cos(beta_n) * math.sin(gamma_n)
            beta = -s / self._m1 - bias_beta * ARCMIN
        return s, u1, (float(w[2]) + drift2) / (1.0 + self.scale2), beta, gamma

    def _mean(self, drift_degph: Callable[[float], float], length_s: float) -> float:
        """Of a drift over the window about this instant, deg/h."""
        return sum(drift_degph(self.t_s + length_s * x) for x in MIDDLES) / len(MIDDLES)

    # ---- PlatformBench

    def prepare(self, *, latitude_rad: float, m1_per_s: float, m2_per_s: float) -> None:
        self._told_rad, self._m1, self._m2 = latitude_rad, m1_per_s, m2_per_s

    def level(self, timeout_s: float) -> None:
        if not self.settles:
            raise LinkError(f"the platform was not level after {timeout_s:g} s: it never settles")
        self.t_s += 10.0

    def measure(self, table: Table, done: Callable[[Window], None]) -> Sequence[Window]:
        windows = []
        self._settle_s = table.settle_s
        for k, angle_deg in enumerate(table.sequence_deg):
            before = self._set
            self.heading_deg += self.vehicle_turns_deg.get(k, 0.0)
            self.pitch_deg += self.vehicle_tilts_deg.get(k, 0.0)
            self._set = math.radians(angle_deg)
            off_arcmin = self.set_sd_arcmin * self.rng.standard_normal() + self.angle_zero_arcmin
            self._q = self._set - off_arcmin * ARCMIN
            self.t_s += abs(math.degrees(self._set - before)) / table.slew_dps + table.settle_s
            windows.append(self._window(k, table.window_s))
            done(windows[-1])
        return windows

    def calibrate(self, length_s: float, settle_s: float) -> Window:
        self.t_s += settle_s
        self._settle_s = math.inf
        return self._window(0, length_s)

    def _window(self, number: int, length_s: float) -> Window:
        n = round(length_s / STEP_S)
        t_mid_s = self.t_s + length_s / 2.0
        self.t_s = t_mid_s
        shift_arcmin = self.level_sd_arcmin * self.rng.standard_normal(2)  # of the level sensors, in this setting
        s, u1, u2, _, gamma = self.settled(self._q, length_s, shift_arcmin)
        read = self.read_sd_arcmin * ARCMIN * self.rng.standard_normal()
        encoder = self._shown_rad() + (read if self.stuck_deg is None else 0.0)
        at_s = STEP_S * np.arange(n, dtype=np.float64)
        swing = self.left_gimbal_arcmin * ARCMIN * np.exp(-self._m2 * (self._settle_s + at_s))
        rate = s + self._m2 * swing * math.sin(gamma)  # levelling takes a turn about the vertical for a rate
        self.t_s = t_mid_s + length_s / 2.0
        w = Window(
            number=number,
            set_rad=self._set,
            t_mid_s=t_mid_s,
            beta_rad=self._levelled(np.asarray(rate)),
            gamma_rad=np.full(n, gamma + (self.bias_gamma_arcmin + shift_arcmin[0]) * ARCMIN),
            u1_radps=np.full(n, u1),
            u2_radps=np.full(n, u2),
            encoder_rad=encoder + swing,
            turned_rad=self._turned(t_mid_s - length_s / 2.0 + at_s, u1, u2, gamma) + swing,
            missed=0,
            step_s=STEP_S,
            m1_per_s=self._m1,
            latitude_rad=self._told_rad,
        )
        return replace(w, **self.broken.get(number, {}))  # type: ignore[arg-type]

    def _levelled(self, rate_radps: Array) -> Array:
        """beta as it is measured in the steps of a window: what levelling makes of rate, noise and a turn's remnant."""
        n, keep = len(rate_radps), 1.0 - self._m1 * STEP_S
        noise = self.noise_arcmin * ARCMIN * self.rng.standard_normal(n)
        before = self.noise_arcmin * ARCMIN * math.sqrt(self._m1 * STEP_S / 2.0) * self.rng.standard_normal()
        first = -rate_radps[0] / self._m1 + before
        first += self.left_beta_arcmin * ARCMIN * math.exp(-self._m1 * self._settle_s)
        drive = np.concatenate([[first], -STEP_S * (rate_radps + self._m1 * noise)[:-1]])
        return np.asarray(lfilter([1.0], [1.0, -keep], drive)) + noise

    def _turned(self, t_s: Array, u1_radps: float, u2_radps: float, gamma_rad: float) -> Array:
        """What the torquers turned the platform by until each instant: its turns, and what Earth and drifts took."""
        q_rad, psi_rad = self._q, math.radians(self.heading_deg)
        alpha = q_rad - psi_rad + math.remainder(self.attitude(q_rad, 0.0)[0] - q_rad + psi_rad, math.tau)
        idle = u2_radps * math.cos(gamma_rad) - u1_radps * math.sin(gamma_rad)
        since_s, before, total = self._idle
        total += (before + idle) / 2.0 * (float(t_s[0]) - since_s)
        taken = total + idle * (t_s - t_s[0])
        self._idle = (float(t_s[-1]), idle, float(taken[-1]))
        return np.asarray(alpha * (1.0 - self.scale2) + taken)

    def navigate(self, c: Compensation) -> None:
        self._comp, self._held_since_s = c, self.t_s
        self._alpha_hold = self.attitude(self._q, 0.0)[0]

    def moved(self, *, latitude_rad: float, speed_mps: float, track_rad: float) -> None:
        self._told_rad = latitude_rad

    def look(self) -> Look:
        self._drift_to_now()
        encoder = self._shown_rad()
        azimuth = self._comp.azimuth_rad if self._comp else 0.0
        return Look(t_s=self.t_s, encoder_rad=encoder, heading_rad=(encoder - azimuth) % (2.0 * math.pi))

    def _shown_rad(self) -> float:
        """Of the angle sensor, without what is new in each setting."""
        if self.stuck_deg is not None:
            return math.radians(self.stuck_deg)
        return self._q + self.angle_zero_arcmin * ARCMIN

    def wait(self, dwell_s: float) -> None:
        self.t_s += dwell_s

    def _drift_to_now(self) -> None:
        """The azimuth of a free platform: what its drift has more than the compensation turns it."""
        if self._comp is None:
            return
        t = np.linspace(self._held_since_s, self.t_s, 200)
        excess = np.array([self.drift2_degph(x) * DEGPH for x in t]) - self._comp.drift2_radps
        wrong = U_DEGPH * DEGPH * (math.sin(self._told_rad) - math.sin(math.radians(self.latitude_deg)))
        alpha = self._alpha_hold + wrong * (t[-1] - t[0]) - float(np.trapezoid(excess, t))
        self._q = self.gimbal(alpha, self._q)
