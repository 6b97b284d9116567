"""What PSA-2's converter filter does to its zero and to interference, through the wire, beside what is published.

Section 5 of the article (boards) says that the tunable filter improves the drift of zero, its conclusion that these
converters must be protected from interference. Here the rate, the phase and the gain are written to the converters'
registers; what comes over CAN is judged by its Allan deviation and by its sine at the frequency to which the sampling
folds a disturbance. The predictions come from the published coefficients, formulas and signal to noise ratios.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psabench.bench import Bench
from psabench.boards.psa2 import converter_filter
from psabench.boards.psa2.device import DATA_HZ, Psa2
from psabench.estimate.allan import allan_deviation
from psabench.link.signals import Floats

MOD_HZ = 1_024_000.0  # 4.096 MHz / 4, converter data sheet
VREF_V, DIVIDER = 5.0, 8.0  # article; profile
POLE_HZ = 10e3  # of the board, E0
# SNR, dB, of a full-scale sine by gain, for 250 SPS; 3 dB less for each doubling of the rate (docs/chips/ads1282.md).
SNR_DB: Mapping[int, float] = {1: 130.0, 2: 130.0, 4: 129.0, 8: 128.0, 16: 125.0, 32: 119.0, 64: 114.0}
PHASES = ("linear", "minimum")
CONFIG0, CONFIG1 = "CONFIG0", "CONFIG1"
CHOPPER = 0x08  # of CONFIG1, as it is after reset


@dataclass(frozen=True, slots=True)
class Setting:
    """A choice of the converter's filter and gain."""

    rate_hz: int = 1000
    phase: str = "minimum"
    gain: int = 2

    @property
    def config0(self) -> int:
        """Sinc and FIR, pulse sync."""
        dr = next(code for code, hz in DATA_HZ.items() if hz == self.rate_hz)
        return 0x42 | dr << 3 | PHASES.index(self.phase) << 2

    @property
    def config1(self) -> int:
        return CHOPPER | self.gain.bit_length() - 1

    @property
    def ratio(self) -> int:
        """Decimation of the sinc."""
        return 32_000 // self.rate_hz

    @property
    def range_v(self) -> float:
        """Full scale at the load."""
        return VREF_V / (2.0 * self.gain) * DIVIDER

    @property
    def noise_v(self) -> float:
        """Published noise of a reading, rms at the load."""
        snr_db = SNR_DB[self.gain] - 10.0 * math.log10(self.rate_hz / 250.0)
        return self.range_v / math.sqrt(2.0) * math.pow(10.0, -snr_db / 20.0)

    @property
    def density_v_rthz(self) -> float:
        """The same as white noise before the filter."""
        h = converter_filter.weights(self.ratio, self.phase)
        band = float(np.sum(h**2) / np.sum(h) ** 2) * converter_filter.BLOCKS / 2.0  # of the data rate
        return self.noise_v / math.sqrt(band * self.rate_hz)

    def __str__(self) -> str:
        return f"{self.rate_hz} SPS, {self.phase}, gain {self.gain}"


def set_up(unit: Psa2, setting: Setting) -> None:
    """Write it to the converters through KPSA, and wait until frames are settled."""
    unit.wait_ready()
    unit.write_register("x", CONFIG1, setting.config1)
    unit.write_register("x", CONFIG0, setting.config0)
    unit.wait_ready()


def record(unit: Psa2, setting: Setting, seconds: float) -> Floats:
    """Volts at the loads, (n, 3), with the gain of the filter at DC taken out."""
    count = int(seconds * setting.rate_hz)
    frames = unit.stream(count, timeout_s=seconds + 5.0)
    codes_at_gain_2 = 2.0 / setting.gain
    return frames.u_v * (codes_at_gain_2 / unit.filter_gain)


# ---- zero


@dataclass(frozen=True, slots=True)
class Zero:
    """Of one setting: rms of a reading (3,), Allan deviations (taus, 3), V, NaN where the record is too short.

    X is the board alone, Y has a sensor whose zero walks, Z the mains.
    """

    setting: Setting
    rms_v: Floats
    allan_v: Floats


def zero_of(bench: Bench, setting: Setting, seconds: float, taus_s: Sequence[float]) -> Zero:
    """One record of the present inputs."""
    unit = bench.board(Psa2)
    set_up(unit, setting)
    u_v = record(unit, setting, seconds)
    allan = np.full((len(taus_s), 3), np.nan)
    for i, tau_s in enumerate(taus_s):
        if 2.0 * tau_s < seconds:
            allan[i] = [allan_deviation(u_v[:, axis], 1.0 / setting.rate_hz, tau_s) for axis in range(3)]
    return Zero(setting, u_v.std(axis=0), allan)


# ---- interference


def folded_hz(hz: float, rate_hz: float) -> float:
    """Frequency at which samples of this rate show it."""
    off = hz % rate_hz
    return min(off, rate_hz - off)


def pole_gain(hz: float, pole_hz: float) -> float:
    """Of the board's filter; pole_hz 0: none."""
    return 1.0 / math.hypot(1.0, hz / pole_hz) if pole_hz else 1.0


def converter_gain(setting: Setting, hz: float) -> float:
    """Of the modulator's sampling, sinc and FIR, by the published coefficients; 1 at DC."""
    dc = converter_filter.at_modulator(setting.ratio, setting.phase, 0.0)
    return converter_filter.at_modulator(setting.ratio, setting.phase, hz / setting.rate_hz) / dc


def amplitude_at(u_v: Floats, hz: float, rate_hz: float) -> float:
    """Of a sine of known frequency beside a constant and a slope, by least squares."""
    t_s = np.arange(len(u_v)) / rate_hz
    x = 2.0 * np.pi * hz * t_s
    columns = np.column_stack([np.sin(x), np.cos(x), np.ones_like(t_s), t_s - t_s.mean()])
    found = np.linalg.lstsq(columns, u_v, rcond=None)[0]
    return float(np.hypot(found[0], found[1]))


@dataclass(frozen=True, slots=True)
class Tone:
    """A disturbance of 1 times amplitude_v at the load: as predicted and as seen, V; by unit."""

    setting: Setting
    hz: float
    seen_hz: float
    predicted_v: Mapping[str, float]
    seen_v: Mapping[str, float]
    floor_v: float  # what the noise alone gives, rms


UNITS: Mapping[str, float] = {"filtered": POLE_HZ, "bare": 0.0}


def tones(bench: Bench, setting: Setting, hz: Sequence[float], *, amplitude_v: float, count: int) -> list[Tone]:
    """Three at a time, one an axis, on both units."""
    units = {name: bench.board(Psa2, name) for name in UNITS}
    for unit in units.values():
        set_up(unit, setting)
    out = []
    for first in range(0, len(hz), 3):
        three = hz[first : first + 3]
        out += _three(bench, units, setting, three, amplitude_v, count)
    return out


def _three(
    bench: Bench, units: Mapping[str, Psa2], setting: Setting, hz: Sequence[float], amplitude_v: float, count: int
) -> list[Tone]:
    added = [
        bench.fault("analog.ripple", f"{name}.afe.{axis}", amplitude_v=amplitude_v, frequency_hz=f)
        for name in units
        for axis, f in zip("xyz", hz, strict=False)
    ]
    bench.wait(70.0 / setting.rate_hz)  # the converter's filter settles
    u_v = {name: record(unit, setting, count / setting.rate_hz) for name, unit in units.items()}
    for fault in added:
        fault.clear()
    out = []
    for axis, f in enumerate(hz):
        seen_hz = folded_hz(f, setting.rate_hz)
        gain = converter_gain(setting, f)
        out.append(
            Tone(
                setting=setting,
                hz=f,
                seen_hz=seen_hz,
                predicted_v={n: amplitude_v * gain * pole_gain(f, pole) for n, pole in UNITS.items()},
                seen_v={n: amplitude_at(v[:, axis], seen_hz, setting.rate_hz) for n, v in u_v.items()},
                floor_v=setting.noise_v * math.sqrt(2.0 / count),
            )
        )
    return out
