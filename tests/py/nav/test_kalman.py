"""The Kalman filter of libpsabench-nav beside dense Joseph updates in NumPy: both forms, smoother, refusals."""

from __future__ import annotations

import ctypes as c
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from kalman_reference import Step, dense_step, joseph, relative
from psabench.native.nav import Floats
from psabench.native.navlib import library
from psabench.native.sins import Form, error_nees
from psabench.native.sinslib import InnovationStruct

NOT_FINITE, RANGE, SINGULAR = -4, -5, -7
FORMS = [Form.JOSEPH, Form.UD]


def at(a: Floats) -> Any:
    assert a.dtype == np.float64
    assert a.flags.c_contiguous
    return a.ctypes.data_as(c.POINTER(c.c_double))


class Filter:
    """A filter in memory of Python's."""

    def __init__(self, n: int, moving: int, form: Form) -> None:
        self.lib, self.n = library(), n
        self.memory = c.create_string_buffer(self.lib.kf_bytes())
        self.kf = c.c_void_p()
        assert self.lib.kf_start(self.memory, len(self.memory), n, moving, int(form), c.byref(self.kf)) == 0

    def set(self, x: Floats, p: Floats) -> int:
        return int(self.lib.kf_set(self.kf, at(x), at(p)))

    def predict(self, phi: Floats, q: Floats) -> int:
        return int(self.lib.kf_predict(self.kf, at(phi), at(q)))

    def update(self, h: Floats, z: Floats, r: Floats, out: Any = None) -> int:
        return int(self.lib.kf_update(self.kf, at(h), at(z), at(r), len(z), out))

    def get(self) -> tuple[Floats, Floats]:
        x, p = np.empty(self.n), np.empty((self.n, self.n))
        self.lib.kf_get(self.kf, at(x), at(p))
        return x, p


def random_steps(n: int, moving: int, count: int, seed: int = 1) -> Iterator[Step]:
    rng = np.random.default_rng(seed)
    for _ in range(count):
        phi = rng.normal(0, 0.2, (moving, n)) * (rng.random((moving, n)) < 0.5)
        phi[:, :moving] += 0.9 * np.eye(moving)
        root = rng.normal(0, 0.1, (moving, moving))
        h = rng.normal(0, 1, (3, n)) * (rng.random((3, n)) < 0.7)
        yield Step(phi, root @ root.T, h, rng.normal(0, 1, 3), rng.uniform(0.1, 2.0, 3))


def start_covariance(n: int) -> Floats:
    rng = np.random.default_rng(7)
    root = rng.normal(0, 1, (n, n)) * 10.0 ** rng.uniform(-2, 2, n)[:, None]
    return np.ascontiguousarray(root @ root.T)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("n", "moving"), [(1, 1), (4, 0), (12, 3), (24, 3), (45, 9), (64, 20), (6, 6)])
def test_a_random_system_is_filtered_as_dense_joseph_updates_do(form: Form, n: int, moving: int) -> None:
    f, x, p = Filter(n, moving, form), np.zeros(n), start_covariance(n)
    assert f.set(x, p) == 0
    for s in random_steps(n, moving, 60):
        assert f.predict(s.phi, s.q) == 0
        assert f.update(s.h, s.z, s.r) == 0
        *_, x, p = dense_step(x, p, s)
        got_x, got_p = f.get()
        assert relative(got_p, p) < 1e-9
        assert np.max(np.abs(got_x - x) / np.sqrt(np.diag(p))) < 1e-9
        assert np.array_equal(got_p, got_p.T)


@pytest.mark.parametrize("form", FORMS)
def test_innovations_are_those_before_each_scalar(form: Form) -> None:
    n, f = 8, Filter(8, 2, form)
    x, p = np.zeros(n), start_covariance(n)
    f.set(x, p)
    (s,) = random_steps(n, 2, 1)
    out = (InnovationStruct * 3)()
    one = InnovationStruct()
    assert f.lib.kf_innovate(f.kf, at(s.h), s.z[0], s.r[0], c.byref(one)) == 0
    assert f.update(s.h, s.z, s.r, out) == 0
    assert (one.value, one.variance) == (out[0].value, out[0].variance)
    for k in range(3):
        assert out[k].value == pytest.approx(s.z[k] - s.h[k] @ x, rel=1e-9)
        assert out[k].variance == pytest.approx(s.h[k] @ p @ s.h[k] + s.r[k], rel=1e-9)
        x, p = joseph(x, p, s.h[k : k + 1], s.z[k : k + 1], s.r[k : k + 1])
    # The NIS of the whole is the sum of those of the scalars.
    (s,) = random_steps(n, 2, 1)
    p = start_covariance(n)
    want = s.z @ np.linalg.inv(s.h @ p @ s.h.T + np.diag(s.r)) @ s.z
    assert sum(i.value**2 / i.variance for i in out) == pytest.approx(want, rel=1e-9)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("bad", range(7))
def test_scalars_before_a_bad_one_are_taken_and_no_other(form: Form, bad: int) -> None:
    """Seven at once, of which the `bad`th has no variance; the filter takes them by groups."""
    n, f = 9, Filter(9, 2, form)
    x, p = np.zeros(n), start_covariance(n)
    f.set(x, p)
    steps = list(random_steps(n, 2, 3))
    h, z, r = (np.concatenate(rows)[:7] for rows in zip(*((s.h, s.z, s.r) for s in steps), strict=True))
    r[bad] = 0.0
    out = (InnovationStruct * 7)()
    assert f.update(h, z, r, out) == RANGE
    for k in range(bad):
        assert out[k].value == pytest.approx(z[k] - h[k] @ x, rel=1e-9)
        x, p = joseph(x, p, h[k : k + 1], z[k : k + 1], r[k : k + 1])
    assert [i.variance for i in out[bad:]] == [0.0] * (7 - bad)
    got_x, got_p = f.get()
    assert relative(got_p, p) < 1e-9
    assert np.max(np.abs(got_x - x) / np.sqrt(np.diag(p))) < 1e-9


def test_ud_keeps_a_positive_covariance_where_the_other_form_may_lose_it() -> None:
    """Bierman's example: measurements far better than the prior, nearly alike."""
    e = 1e-9
    h, r = np.array([[1.0, e], [1.0, 1.0]]), np.full(2, e * e)
    f = Filter(2, 0, Form.UD)
    f.set(np.zeros(2), np.eye(2))
    assert f.update(h, np.zeros(2), r) == 0
    p = f.get()[1]
    want = np.array([[1.0, -1.0], [-1.0, 2.0]]) * e * e  # to the first order of e
    assert p == pytest.approx(want, rel=1e-6)
    assert np.linalg.eigvalsh(p / np.sqrt(np.outer(np.diag(p), np.diag(p)))).min() > 0.1


@pytest.mark.parametrize("form", FORMS)
def test_a_known_state_and_a_clone_are_no_singular_prior(form: Form) -> None:
    p = np.array([[2.0, 2.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 0.0]])  # 1 is a clone of 0, 2 is known
    f = Filter(3, 1, form)
    assert f.set(np.zeros(3), p) == 0
    x = np.zeros(3)
    for s in random_steps(3, 1, 20, seed=3):
        assert f.predict(s.phi, s.q) == 0
        assert f.update(s.h, s.z, s.r) == 0
        *_, x, p = dense_step(x, p, s)
    got_x, got_p = f.get()
    assert got_p == pytest.approx(p, abs=1e-10)
    assert got_x == pytest.approx(x, abs=1e-10)


@pytest.mark.parametrize("form", FORMS)
def test_what_is_no_covariance_is_rejected_and_changes_nothing(form: Form) -> None:
    f, good = Filter(2, 1, form), np.array([[2.0, 0.5], [0.5, 1.0]])
    f.set(np.ones(2), good)
    bad = {
        SINGULAR: [
            np.array([[1.0, 2.0], [2.0, 1.0]]),
            np.array([[-1.0, 0.0], [0.0, 1.0]]),
            np.array([[1.0, 0.2], [0.1, 1.0]]),
        ],
        NOT_FINITE: [np.array([[math.nan, 0.0], [0.0, 1.0]]), np.array([[1.0, 0.0], [0.0, math.inf]])],
    }
    for status, matrices in bad.items():
        for m in matrices:
            assert f.set(np.zeros(2), m) == status
    one = np.ones((1, 2))
    assert f.update(one, np.array([math.nan]), np.ones(1)) == NOT_FINITE
    assert f.update(one * math.inf, np.ones(1), np.ones(1)) == NOT_FINITE
    assert f.update(one, np.ones(1), np.zeros(1)) == RANGE
    assert f.update(one, np.ones(1), -np.ones(1)) == RANGE
    assert f.predict(one * math.nan, np.ones((1, 1))) == NOT_FINITE
    x, p = f.get()
    assert x.tolist() == [1.0, 1.0]
    assert p == pytest.approx(good, rel=1e-15)


def test_the_smoother_is_that_of_the_textbook() -> None:
    n, moving = 9, 3
    steps = list(random_steps(n, moving, 40))
    x, p = np.zeros(n), start_covariance(n)
    kept = []
    for s in steps:
        before = x, p
        x1, p1, x, p = dense_step(x, p, s)
        kept.append((before, x1, p1))
    xs, ps = x.copy(), p.copy()
    want_x, want_p = x, p
    for s, ((xf, pf), x1, p1) in zip(reversed(steps), reversed(kept), strict=True):
        whole = np.eye(n)
        whole[:moving] = s.phi
        gain = pf @ whole.T @ np.linalg.inv(p1)
        want_x, want_p = xf + gain @ (want_x - x1), pf + gain @ (want_p - p1) @ gain.T
        args = [at(np.ascontiguousarray(a)) for a in (s.phi, s.q, x1, p1)]
        assert library().kf_smooth(n, moving, *args, at(xs), at(ps)) == 0
    assert np.max(np.abs(xs - want_x) / np.sqrt(np.diag(want_p))) < 1e-6
    assert relative(ps, want_p) < 1e-6


def test_the_smoother_rejects_what_it_cannot_go_back_through() -> None:
    phi, one, x = np.zeros((1, 2)), np.ones((1, 1)), np.zeros(2)
    p = np.eye(2)
    assert library().kf_smooth(2, 1, at(phi), at(one), at(x), at(p), at(x), at(p)) == SINGULAR


def test_nees_is_the_quadratic_form() -> None:
    p, e = start_covariance(10), np.arange(10.0)
    assert error_nees(e, p) == pytest.approx(e @ np.linalg.inv(p) @ e, rel=1e-6)
    assert math.isnan(error_nees(np.ones(2), np.array([[1.0, 0.0], [0.0, 0.0]])))


def test_sizes_and_forms_beyond_the_limits_are_rejected() -> None:
    lib, memory, kf = library(), c.create_string_buffer(library().kf_bytes()), c.c_void_p()
    size = len(memory)
    for n, moving, form, given in [
        (0, 0, 0, size),
        (65, 1, 0, size),
        (4, 5, 0, size),
        (4, 1, 2, size),
        (4, 1, 0, size - 1),
    ]:
        assert lib.kf_start(memory, given, n, moving, form, c.byref(kf)) == RANGE
    assert lib.kf_start(None, size, 4, 1, 0, c.byref(kf)) == RANGE
