"""PSA-2: what the converter's filter can do for the zero and against interference, and what it cannot.

.venv/bin/python examples/filter_study.py
"""

from __future__ import annotations

import math
from pathlib import Path

from psabench import Bench
from psabench.estimate import allan
from psabench.procedures import filter_study as fs

HERE = Path(__file__).parent
TAUS_S = (1.0, 10.0, 100.0)
SECONDS = {250: 400.0, 1000: 250.0, 4000: 10.0}  # by rate
WALK_V_RTS, MAINS_V, MAINS_HZ = 1e-7, 1e-3, 49.93  # filter_study_drift.yaml
SETTINGS = (
    *(fs.Setting(rate_hz=rate) for rate in SECONDS),
    fs.Setting(rate_hz=250, phase="linear"),
    *(fs.Setting(rate_hz=250, gain=gain) for gain in (1, 8, 64)),
)
RATES_HZ = (1000, 4000)
TONES_HZ = (50.0, 413.0, 950.0, 3_960.0, 31_960.0, 1_023_960.0, 1_024_001.0, 1_024_040.0, 2_048_050.0)
TONE_V, WORDS = 0.1, 1000


def zeros() -> list[fs.Zero]:
    """Each setting on a bench of its own, so that none inherits a walk."""
    out = []
    for setting in SETTINGS:
        with Bench.start(HERE / "filter_study_drift.yaml") as bench:
            out.append(fs.zero_of(bench, setting, SECONDS[setting.rate_hz], TAUS_S))
    return out


def pair(measured_v: float, predicted_v: float) -> str:
    """In uV; a record too short for it: -."""
    return f"{'-':>16}" if math.isnan(measured_v) else f"{1e6 * measured_v:>9.3f} /{1e6 * predicted_v:>5.3f}"


def print_zeros(found: list[fs.Zero]) -> None:
    print("uV at the load, measured / predicted: rms of a reading, Allan deviation over 1, 10, 100 s")
    print("X: the board alone, Y: a sensor whose zero walks, Z: the mains")
    columns = ("rms X", "X 1 s", "X 10 s", "X 100 s", "Y 100 s", "Z 1 s")
    print(f"{'setting':<25}{'range':>8}" + "".join(f"{c:>16}" for c in columns))
    for z in found:
        s, white = z.setting, [allan.of_white(z.setting.density_v_rthz, tau) for tau in TAUS_S]
        walk = math.hypot(white[2], allan.of_walk(WALK_V_RTS, TAUS_S[2]))
        mains = math.hypot(white[0], allan.of_sine(MAINS_V, MAINS_HZ, TAUS_S[0]))
        pairs = (
            (z.rms_v[0], s.noise_v),
            *zip(z.allan_v[:, 0], white, strict=True),
            (z.allan_v[2, 1], walk),
            (z.allan_v[0, 2], mains),
        )
        print(f"{s!s:<25}{min(s.range_v, 10.0):>6.2f} V" + "".join(pair(*p) for p in pairs))


def tones() -> list[fs.Tone]:
    """At three rates."""
    with Bench.start(HERE / "filter_study_interference.yaml") as bench:
        found = [
            t
            for rate in RATES_HZ
            for t in fs.tones(bench, fs.Setting(rate_hz=rate), TONES_HZ, amplitude_v=TONE_V, count=WORDS)
        ]
    return found


def decibel(v: float) -> str:
    """Of TONE_V; what no record of this length could show is not told apart."""
    level = 20.0 * math.log10(v / TONE_V) if v > 0.0 else -math.inf
    return f"{'< -140':>10}" if level < -140.0 else f"{level + 0.0 if abs(level) >= 0.005 else 0.0:>10.2f}"


def print_tones(found: list[fs.Tone]) -> None:
    print(f"\na sine of {TONE_V:g} V at the load, as it is seen, dB of it: predicted, measured")
    columns = ("no filter", "measured", "10 kHz", "measured", "floor")
    print(f"{'SPS':>5}{'in, Hz':>12}{'seen, Hz':>10}" + "".join(f"{c:>10}" for c in columns))
    for t in found:
        cells = "".join(decibel(t.predicted_v[u]) + decibel(t.seen_v[u]) for u in ("bare", "filtered"))
        print(f"{t.setting.rate_hz:>5}{t.hz:>12.0f}{t.seen_hz:>10.0f}{cells}{decibel(t.floor_v)}")


if __name__ == "__main__":
    print_zeros(zeros())
    print_tones(tones())
