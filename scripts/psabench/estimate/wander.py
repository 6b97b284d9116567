"""Whether a zero wanders in a run: readings of the same positions, in the order of time, against white noise.

King's point optimal test (1987) of white noise against noise with a random walk in it: the ratio of the residuals'
squares weighed as that walk would have them to the squares themselves. Its distribution for white noise is exact (Imhof
1961), so that false alarms come as often as the p value says.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LEAST_DOF = 4
NEGLIGIBLE = 1e-7  # of the largest reading: codes and rounding
MOST_ROWS = 1000  # later ones are not looked at: time grows with their cube
WALK = 10.0  # a walk of so many sd of the noise over the run is what the test sees best
POINTS = 2000  # of Imhof's integral


def wander_p(u_v: Array, position: npt.NDArray[np.int64], t_s: Array | None = None) -> float | None:
    """P value of white noise about the mean of each position; None: too little was repeated, or nothing is noisy.

    u_v: (n,) in the order of time. position: (n,) numbers of what must read alike. t_s: (n,), where a zero that moves
    on a straight line is allowed.
    """
    u_v, position = u_v[:MOST_ROWS], position[:MOST_ROWS]
    design = (position[:, np.newaxis] == np.unique(position)).astype(np.float64)
    if t_s is not None:
        design = np.column_stack([design, t_s[:MOST_ROWS] - t_s[:MOST_ROWS].mean()])
    free = _complement(design)
    e_v = free.T @ u_v
    if free.shape[1] < LEAST_DOF or float(np.sqrt(np.mean(e_v**2))) <= NEGLIGIBLE * float(np.abs(u_v).max()):
        return None
    sums = np.cumsum(free[::-1], axis=0)
    walk, axes = np.linalg.eigh(sums.T @ sums)
    weight = 1.0 / (1.0 + (WALK / len(u_v)) ** 2 * walk)
    squares = (axes.T @ e_v) ** 2
    return 1.0 - _chance_above(float(weight @ squares / squares.sum()), weight)


def _complement(design: Array) -> Array:
    """Orthonormal columns, (n, n - rank), across those of the design."""
    u, s, _ = np.linalg.svd(design, full_matrices=True)
    return np.asarray(u[:, int((s > 1e-10 * s[0]).sum()) :])


def _chance_above(ratio: float, weight: Array) -> float:
    """P(sum w z^2 / sum z^2 > ratio) for normal z, by Imhof's integral of the characteristic function."""
    w = weight - ratio
    w = w / np.abs(w).max()
    x = (np.arange(POINTS) + 0.5) / POINTS
    u = x / (1.0 - x)  # 0 to infinity
    wu = np.outer(u, w)
    decay = np.exp(-0.25 * np.log1p(wu**2).sum(axis=1))
    integrand = np.sin(0.5 * np.arctan(wu).sum(axis=1)) * decay / u / (1.0 - x) ** 2
    return float(np.clip(0.5 + integrand.mean() / np.pi, 0.0, 1.0))
