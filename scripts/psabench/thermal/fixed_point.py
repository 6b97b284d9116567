"""A compensation as a C header for a navigation computer without floating point, and the same integers in Python.

Clenshaw's recurrence in 64-bit integers: temperature in thousandths of a degree, scaled temperature with 30 bits behind
the point, coefficients as multiples of a step. The quantisation error that the header states is the largest difference
from the compensation in double precision over every thousandth of its range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.thermal.compensation import Compensation, Lag

X_BITS = 30
SUM_BITS = 32  # what the recurrence may reach: products with the scaled temperature stay below 2^63
FINE_BITS = 8  # the recurrence's own, below the step of the result
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class FixedPoint:
    """Integers of a compensation. A result is in `step`s of the quantity's unit."""

    quantity: str
    low_mdegc: int
    high_mdegc: int
    coefficients: tuple[int, ...]  # in step / 2^FINE_BITS
    step: float
    error: float  # largest, of the quantity's unit, inside the range
    lag: Lag | None  # not in these integers

    def value_at(self, element_mdegc: npt.ArrayLike) -> Integers:
        """As the C function gives it, the same to the bit; temperature in thousandths of deg C."""
        t = np.clip(np.asarray(element_mdegc, np.int64), self.low_mdegc, self.high_mdegc)
        span = self.high_mdegc - self.low_mdegc
        x = np.asarray((2 * t - self.low_mdegc - self.high_mdegc) * (1 << X_BITS)) // span
        after = last = np.zeros_like(x)
        for c in self.coefficients[:0:-1]:
            after, last = c + _rounded_product(x, after, X_BITS - 1) - last, after
        total = self.coefficients[0] + _rounded_product(x, after, X_BITS) - last
        return np.asarray((total + (1 << (FINE_BITS - 1))) >> FINE_BITS)


def _rounded_product(x: Integers, y: Integers, shift: int) -> Integers:
    """Product, rounded to the nearest."""
    return np.asarray((x * y + (1 << (shift - 1))) >> shift)


def fixed_point(c: Compensation, step: float) -> FixedPoint:
    """Integers of a compensation whose result counts `step`s of its unit. The lag's column is the caller's to add.

    Raises BadInput for a step so small that the coefficients do not fit.
    """
    fine = step / (1 << FINE_BITS)
    # |b_k| of the recurrence is at most the sum of (j + 1) |c_j|.
    least = sum((j + 1) * abs(k) for j, k in enumerate(c.coefficients)) / (1 << (SUM_BITS - FINE_BITS))
    if not least < step < math.inf:
        raise BadInput(expected(f"a step above {least:.3g}", f"{step:g}", c.quantity))
    low, high = (round(1000.0 * t) for t in (c.low_c, c.high_c))
    numbers = tuple(round(k / fine) for k in c.coefficients)
    made = FixedPoint(
        quantity=c.quantity, low_mdegc=low, high_mdegc=high, coefficients=numbers, step=step, error=0.0, lag=c.lag
    )
    every = np.arange(low, high + 1)
    error = np.abs(made.value_at(every) * step - c.value_at(every / 1000.0)).max()
    return FixedPoint(**{**made.__dict__, "error": float(error)})


C_WORDS = frozenset(  # C11, 6.4.1
    "auto break case char const continue default do double else enum extern float for goto if inline int long register"
    " restrict return short signed sizeof static struct switch typedef union unsigned void volatile while".split()
)
_LAG = """
 * NOT in this function: add {per_k:.9g} a kelvin that the case is warmer than the element, which follows the
 * case with a time constant of {tau_s:.6g} s."""
_HEADER = """\
/* Compensation of {quantity} against the temperature of the element, {low:.3f} to {high:.3f} degC; clamped outside.
 * Polynomial of degree {degree} in Chebyshev form. A result counts {step:.9g} of the quantity's unit.
 * Largest error of these integers against double precision: {error:.3g}. Made by psabench {version}.{lag} */
#ifndef {guard}
#define {guard}

#include <stdint.h>

static inline int64_t {name}_times(int64_t x, int64_t y, int shift)
{{
    return (x * y + ((int64_t)1 << (shift - 1))) >> shift; /* arithmetic shift, as of gcc, clang and CCS */
}}

/* element_mdegc: temperature in thousandths of degC. */
static inline int32_t {name}(int32_t element_mdegc)
{{
    static const int64_t c[] = {{{coefficients}}};
    const int64_t low = {low_mdegc}, high = {high_mdegc};
    const int64_t t = element_mdegc < low ? low : element_mdegc > high ? high : element_mdegc;
    const int64_t n = (2 * t - low - high) * ((int64_t)1 << {x_bits}), d = high - low;
    const int64_t x = n / d - (n % d < 0); /* rounded down */
    int64_t after = 0, last = 0;
    for (int k = {degree}; k > 0; k--) {{
        const int64_t b = c[k] + {name}_times(x, after, {x_bits} - 1) - last;
        last = after;
        after = b;
    }}
    return (int32_t)((c[0] + {name}_times(x, after, {x_bits}) - last + {half}) >> {fine_bits});
}}

#endif
"""


def c_header(f: FixedPoint, name: str) -> str:
    """The header's text, with a function `name`. Raises BadInput for a name that C does not take."""
    from importlib.metadata import version

    if not (name.isidentifier() and name.isascii()) or name in C_WORDS:
        raise BadInput(expected("a name of C", name, "header"))
    lag = f.lag and _LAG.format(tau_s=f.lag.tau_s, per_k=f.lag.per_k)
    return _HEADER.format(
        quantity=f.quantity,
        low=f.low_mdegc / 1000,
        high=f.high_mdegc / 1000,
        low_mdegc=f.low_mdegc,
        high_mdegc=f.high_mdegc,
        degree=len(f.coefficients) - 1,
        step=f.step,
        error=f.error,
        version=version("psabench"),
        lag=lag or "",
        guard=f"{name.upper()}_H",
        name=name,
        coefficients=", ".join(str(k) for k in f.coefficients),
        x_bits=X_BITS,
        fine_bits=FINE_BITS,
        half=1 << (FINE_BITS - 1),
    )
