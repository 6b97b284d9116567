"""Histogram, Allan deviation and spectrum of a channel's latest samples, as a page draws them."""

from __future__ import annotations

from typing import Any

import numpy as np

from psabench.errors import BenchError, expected
from psabench.estimate.allan import allan_deviation
from psabench.link.signals import Floats

LEAST = 64  # samples; fewer say nothing
BINS = 60  # of the histogram
POINTS = 160  # of the spectrum, at even ratios of frequency
SEGMENT = 2048  # samples in a segment of the spectrum


def channel_statistics(t_s: Floats, values: Floats, unit: str) -> dict[str, Any]:
    """Of samples at an even rate. Raises BenchError for too few, or for a channel that not every sample has."""
    if len(values) < LEAST:
        raise BenchError(expected(f"at least {LEAST} samples", len(values), "statistics"))
    if not np.isfinite(values).all():
        raise BenchError("statistics: expected a value in every sample, got gaps: this channel is multiplexed")
    step_s = float(np.median(np.diff(t_s)))
    if step_s <= 0:
        raise BenchError(expected("rising times of arrival", f"a step of {step_s:g} s", "statistics"))
    counts, edges = np.histogram(values, BINS)
    taus_s = _taus_s(len(values), step_s)
    hz, density = amplitude_density(values, step_s)
    return {
        "unit": unit,
        "count": len(values),
        "step_s": step_s,
        "mean": float(values.mean()),
        "std": float(values.std(ddof=1)),
        "histogram": {"x": ((edges[1:] + edges[:-1]) / 2 - values.mean()).tolist(), "y": counts.tolist()},
        "allan": {"x": taus_s, "y": [allan_deviation(values, step_s, tau_s) for tau_s in taus_s]},
        "spectrum": {"x": hz.tolist(), "y": density.tolist()},
    }


def _taus_s(count: int, step_s: float) -> list[float]:
    """Four in an octave, whole steps, up to a quarter of the record: there are three neighbouring pairs."""
    steps = np.unique(np.round(2.0 ** (np.arange(0, 4 * np.log2(count / 4)) / 4)).astype(int))
    return [float(m) * step_s for m in steps]


def amplitude_density(values: Floats, step_s: float) -> tuple[Floats, Floats]:
    """Frequencies, Hz, and one-sided amplitude density per root Hz, by Welch's method: Hann, half overlap."""
    n = min(SEGMENT, len(values))
    window = np.hanning(n + 1)[:-1]
    starts = range(0, len(values) - n + 1, max(1, n // 2))
    parts = [np.abs(np.fft.rfft(window * (values[k : k + n] - values[k : k + n].mean()))) ** 2 for k in starts]
    power = 2.0 * step_s * np.mean(parts, axis=0) / (window**2).sum()
    hz: Floats = np.asarray(np.fft.rfftfreq(n, step_s), dtype=np.float64)
    power[-1] /= 2.0 if n % 2 == 0 else 1.0  # the highest has no mirror image
    return _in_ratios(hz[1:], power[1:])


def _in_ratios(hz: Floats, power: Floats) -> tuple[Floats, Floats]:
    """Mean power over POINTS bands of equal ratio; empty ones are left out."""
    edges = np.geomspace(hz[0], hz[-1] * (1 + 1e-9), POINTS + 1)
    band = np.clip(np.searchsorted(edges, hz, side="right") - 1, 0, POINTS - 1)
    count = np.bincount(band, minlength=POINTS)
    kept = count > 0
    mean = [np.bincount(band, weights=w, minlength=POINTS)[kept] / count[kept] for w in (hz, power)]
    return mean[0], np.sqrt(mean[1])
