"""A bench in memory: model (1) written a second time, from rotations, sharing no line with the estimators."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from psabench.estimate.face import Face

DEFAULT_SEED = 20080924  # the day the article was received
SEED = int(os.environ.get("TEST_SEED", DEFAULT_SEED))

# The sensor's turn about its own Ox, deg, right-handed. Oz is where Oy stood: y' = -z, z' = y, which is -90.
ABOUT_OX_DEG = {Face.DIRECT: 0.0, Face.REVERSED: 180.0, Face.SIDE: -90.0, Face.SIDE_REVERSED: 90.0}


def seeded(test: str) -> np.random.Generator:
    """A generator of its own for each test; prints what replays it."""
    print(f"{test}: TEST_SEED={SEED}")
    return np.random.default_rng([SEED, *test.encode()])


@dataclass(kw_only=True)
class FakeBench:
    """An accelerometer on a dividing head. The article's sensor unless told otherwise; k in V/g."""

    u0_v: float = 2.50
    alpha0_deg: float = 0.1121
    k: tuple[float, float, float] = (1.0, 0.0098, 0.004)
    kxy: float = 0.0010
    k_square: tuple[float, float, float] = (0.0, 0.0, 0.0)  # kxx, kyy, kzz
    noise_v: float = 0.0
    drift_v_per_s: float = 0.0
    remount_arcsec: float = 0.0  # sd of the turn about the head axis at each mounting
    setting_error_deg: float = 0.0  # sd; the readout shows it
    lsb_v: float = 0.0  # converter step at the load, 0: none
    chain: tuple[float, float] = (0.0, 0.0)  # relative error of the gain, zero in V
    circle_arcsec: tuple[float, float] = (0.0, 0.0)  # error that the scale does not show: of the sine, of the cosine
    reading_s: float = 1.0
    stop_after: int | None = None  # raise KeyboardInterrupt instead of reading number N
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(SEED))
    g_mps2: float = 9.81
    t_s: float = 0.0

    def __post_init__(self) -> None:
        self.reads = 0
        self._readout_deg = 0.0
        self._face = Face.DIRECT
        self._mount_deg = self.alpha0_deg

    def turn(self, angle_deg: float) -> float:
        self._readout_deg = angle_deg + self.setting_error_deg * self.rng.standard_normal()
        return self._readout_deg

    def mount(self, face: Face) -> None:
        self._face = face
        self._mount_deg = self.alpha0_deg + self.remount_arcsec / 3600 * self.rng.standard_normal()

    def wait(self, dwell_s: float) -> None:
        self.t_s += dwell_s

    def gravity_g(self) -> npt.NDArray[np.float64]:
        """Gravity in the sensor's axes, in g: head about z, then the face about the sensor's own x."""
        scale_rad = np.radians(self._readout_deg)
        circle_arcsec = np.array(self.circle_arcsec) @ [np.sin(scale_rad), np.cos(scale_rad)]
        th = scale_rad + np.radians(self._mount_deg + circle_arcsec / 3600)
        ph = np.radians(ABOUT_OX_DEG[self._face])
        c_head = np.array([[np.cos(th), -np.sin(th), 0], [np.sin(th), np.cos(th), 0], [0, 0, 1]])
        c_face = np.array([[1, 0, 0], [0, np.cos(ph), -np.sin(ph)], [0, np.sin(ph), np.cos(ph)]])
        down = np.array([0.0, -1.0, 0.0])  # laboratory: x horizontal, y up, z along the head
        in_sensor: npt.NDArray[np.float64] = (c_head @ c_face).T @ down
        return in_sensor

    def read(self, axis: str, readings: int) -> npt.NDArray[np.float64]:
        if self.stop_after is not None and self.reads >= self.stop_after:
            raise KeyboardInterrupt
        self.reads += 1
        a = self.gravity_g()
        t_s = self.t_s + self.reading_s * (np.arange(readings) + 0.5)
        self.t_s += self.reading_s * readings
        level_v = self.u0_v + a @ self.k + self.kxy * a[0] * a[1] + a**2 @ self.k_square
        u_v = level_v + self.drift_v_per_s * t_s + self.noise_v * self.rng.standard_normal(readings)
        u_v = u_v * (1.0 + self.chain[0]) + self.chain[1]
        out_v: npt.NDArray[np.float64] = np.round(u_v / self.lsb_v) * self.lsb_v if self.lsb_v else u_v
        return out_v
