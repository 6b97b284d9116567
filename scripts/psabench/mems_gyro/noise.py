"""Noise of a rate: Allan deviation, and its terms by restricted likelihood from means of any length. Pure.

Terms of IEEE Std 952, each with its power v in the covariance of two means, over intervals of times t and s:

  white            v1 = N^2   delta(t - s)               Allan variance N^2 / tau
  bias instability v2 = B^2   -ln|t - s| / pi + const    2 ln 2 / pi B^2
  random walk      v3 = K^2   -|t - s| / 2 + const       K^2 tau / 3

The constants do not matter as long as a zero is estimated beside: they cancel in every contrast (intrinsic
covariances).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.estimate.allan import allan_deviation
from psabench.link.signals import Floats

TERMS = ("N", "B", "K")
ROUNDS, CLOSE = 30, 1e-3
LEAST = 1e-9  # of the variance of the readings: a term below is none


def allan_deviations(x: Floats, tau0_s: float) -> tuple[Floats, Floats]:
    """Overlapping, at octaves up to a quarter of the recording: times, deviations."""
    tau_s: Floats = np.float64(tau0_s) * 2.0 ** np.arange((len(x) // 4).bit_length())
    return tau_s, np.array([allan_deviation(x, tau0_s, float(tau)) for tau in tau_s])


def allan_law(v: Floats, tau_s: Floats) -> Floats:
    """Of the terms' powers."""
    law: Floats = np.sqrt(v[0] / tau_s + 2.0 * math.log(2.0) / math.pi * v[1] + v[2] * tau_s / 3.0)
    return law


def _log_twice(t: Floats) -> Floats:
    """-ln|t| integrated twice."""
    square = t * t
    out: Floats = 0.75 * square - 0.5 * square * np.log(np.where(t == 0.0, 1.0, np.abs(t)))
    return out


def _walk_twice(t: Floats) -> Floats:
    out: Floats = -(np.abs(t) ** 3) / 12.0
    return out


def term_kernels(t_s: Floats, duration_s: Floats) -> list[Floats]:
    """Covariance of means over [t, t + duration] by each term of power 1, (n, n) each."""
    span_s = float((t_s + duration_s).max() - t_s.min())
    ends = np.subtract.outer(t_s, t_s)
    shift = duration_s

    def mean_of(twice: Callable[[Floats], Floats]) -> Floats:
        a0b0, a1b0 = twice(ends), twice(ends + shift[:, None])
        a0b1, a1b1 = twice(ends - shift[None, :]), twice(ends + shift[:, None] - shift[None, :])
        out: Floats = (a1b0 + a0b1 - a0b0 - a1b1) / np.outer(shift, shift)
        return out

    log = (mean_of(_log_twice) + math.log(span_s) + 1.0) / math.pi
    return [np.diag(1.0 / duration_s), log, mean_of(_walk_twice) + span_s / 2.0]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFit:
    """Powers of the terms, and how well they are known; of one that was not found, how much could hide."""

    v: Floats  # (3,)
    cov: Floats  # (3, 3)

    @property
    def sd(self) -> Floats:
        return np.sqrt(np.diag(self.cov))


def fit_noise(y: Floats, design: Floats, parts: list[Floats]) -> NoiseFit:
    """Restricted maximum likelihood by Fisher scoring; powers that would be negative are none."""
    free = _free_basis(design)
    z = free.T @ y
    h = [free.T @ g @ free for g in parts]
    scale = np.array([float(z @ z) / float(np.trace(k)) for k in h])
    v = scale / len(h)
    active = np.ones(len(h), dtype=bool)
    for _ in range(ROUNDS):
        score, info = _score_terms(z, h, v)
        step = np.zeros_like(v)
        step[active] = np.linalg.solve(info[np.ix_(active, active)], score[active])
        new = np.where(active, np.maximum(v + step, 0.03 * v), 0.0)
        new, active = _pin_terms(new, scale, active)
        done = bool(np.all(np.abs(new - v) <= CLOSE * np.maximum(new, LEAST * scale)))
        v = new
        if done:
            break
    _, info = _score_terms(z, h, v)
    return NoiseFit(v=v, cov=np.asarray(np.linalg.inv(info), dtype=np.float64))


def _pin_terms(v: Floats, scale: Floats, active: npt.NDArray[np.bool_]) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """White noise stays: without it nothing has an inverse."""
    none = active & (v < LEAST * scale)
    none[0] = False
    return np.where(none, 0.0, v), active & ~none


def _score_terms(z: Floats, h: list[Floats], v: Floats) -> tuple[Floats, Floats]:
    inverse = np.linalg.inv(sum((x * k for x, k in zip(v, h, strict=True)), np.zeros_like(h[0])))
    weighed = [inverse @ k for k in h]
    w = inverse @ z
    score = np.array([0.5 * (float(w @ k @ w) - float(np.trace(m))) for k, m in zip(h, weighed, strict=True)])
    info = np.array([[0.5 * float(np.sum(a * b.T)) for b in weighed] for a in weighed])
    return score, info


def _free_basis(design: Floats) -> Floats:
    """Orthonormal columns across those of the design."""
    scaled = design / np.abs(design).max(axis=0)
    q, _ = np.linalg.qr(scaled, mode="complete")
    return np.asarray(q[:, design.shape[1] :])
