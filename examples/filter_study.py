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
SECONDS = 300.0
WALK_V_RTS, MAINS_V, MAINS_HZ = 1e-7, 1e-3, 49.93  # filter_study_drift.yaml
SETTINGS = (
    *(fs.Setting(rate_hz=rate) for rate in (250, 1000, 4000)),
    fs.Setting(phase="linear"),
    *(fs.Setting(gain=gain) for gain in (1, 8, 64)),
)
RATES_HZ = (250, 1000, 4000)
TONES_HZ = (50.0, 413.0, 950.0, 3_960.0, 31_960.0, 1_023_960.0, 1_024_000.01, 1_024_040.0, 2_048_050.0)
TONE_V, WORDS = 0.1, 1000


def zeros() -> list[fs.Zero]:
    """Each setting on a bench of its own, so that none inherits a walk."""
    out = []
    for setting in SETTINGS:
        with Bench.start(HERE / "filter_study_drift.yaml") as bench:
            out.append(fs.zero_of(bench, setting, SECONDS, TAUS_S))
    return out


def print_zeros(found: list[fs.Zero]) -> None:
    print("Allan deviation, uV at the load, measured / predicted; a reading's rms; X: board, Y: walk, Z: mains")
    print(f"{'setting':<26}{'range':>7}{'rms X':>14}{'X 1 s':>15}{'X 10 s':>15}{'Y 1 s':>14}{'Y 100 s':>14}{'Z 1 s':>14}")
    for z in found:
        s, white = z.setting, [allan.of_white(z.setting.density_v_rthz, tau) for tau in TAUS_S]
        walk = [math.hypot(w, allan.of_walk(WALK_V_RTS, tau)) for w, tau in zip(white, TAUS_S, strict=True)]
        mains = math.hypot(white[0], allan.of_sine(MAINS_V, MAINS_HZ, TAUS_S[0]))
        pairs = (
            *((z.rms_v[0], s.noise_v), (z.allan_v[0, 0], white[0]), (z.allan_v[1, 0], white[1])),
            *((z.allan_v[0, 1], walk[0]), (z.allan_v[2, 1], walk[2]), (z.allan_v[0, 2], mains)),
        )
        cells = "".join(f"{1e6 * a:>8.3f} /{1e6 * b:>6.3f}" for a, b in pairs)
        print(f"{s!s:<25}{min(s.range_v, 10.0):>6.2f} V {cells}")


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
    return f"{20.0 * math.log10(v / TONE_V):8.2f}" if v > 0.0 else "    -inf"


def print_tones(found: list[fs.Tone]) -> None:
    print(f"\na sine of {TONE_V:g} V at the load: what is seen, dB of it, predicted and measured")
    print(f"{'SPS':>5}{'in, Hz':>13}{'seen, Hz':>10}{'bare':>10}{'measured':>10}{'10 kHz':>10}{'measured':>10}{'floor':>9}")
    for t in found:
        cells = "".join(f"  {decibel(t.predicted_v[u])}  {decibel(t.seen_v[u])}" for u in ("bare", "filtered"))
        print(f"{t.setting.rate_hz:>5}{t.hz:>13.2f}{t.seen_hz:>10.2f}{cells} {decibel(t.floor_v)}")


if __name__ == "__main__":
    print_zeros(zeros())
    print_tones(tones())
