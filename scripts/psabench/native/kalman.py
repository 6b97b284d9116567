"""The Kalman filter of libpsabench-nav (kf.h), from Python: constant and moving states, scalar measurements."""

from __future__ import annotations

import ctypes as c

import numpy as np

from psabench.native.nav import Floats, Refused
from psabench.native.navlib import library
from psabench.native.sins import Form
from psabench.native.sinslib import InnovationStruct


class Kalman:
    """A filter of n states, the first `moving` of which move; its memory is Python's. Raises Refused."""

    def __init__(self, x: Floats, p: Floats, moving: int, form: Form = Form.JOSEPH) -> None:
        lib, self.n, self.moving = library(), len(x), moving
        self._memory = c.create_string_buffer(lib.kf_bytes() + 16)
        self.handle = c.c_void_p()
        at = (c.addressof(self._memory) + 15) & ~15
        _check_status("start", lib.kf_start(at, lib.kf_bytes(), self.n, moving, int(form), c.byref(self.handle)))
        _check_status("start", lib.kf_set(self.handle, _as_doubles(x), _as_doubles(p)))

    def update(self, h: Floats, z: Floats, variance: Floats) -> Floats:
        """Scalars z = h x, rows of h. Returns rows (innovation, its variance), each before it was taken."""
        out = (InnovationStruct * len(z))()
        _check_status(
            "update",
            library().kf_update(self.handle, _as_doubles(h), _as_doubles(z), _as_doubles(variance), len(z), out),
        )
        return np.array([[i.value, i.variance] for i in out])

    @property
    def x(self) -> Floats:
        x = np.empty(self.n)
        library().kf_get(self.handle, _as_doubles(x), None)
        return x

    @property
    def p(self) -> Floats:
        p = np.empty((self.n, self.n))
        library().kf_get(self.handle, None, _as_doubles(p))
        return p


def _as_doubles(array: Floats) -> c._Pointer[c.c_double]:
    return np.ascontiguousarray(array, np.float64).ctypes.data_as(c.POINTER(c.c_double))


def _check_status(what: str, status: int) -> None:
    if status < 0:
        raise Refused(f"filter, {what}", status)
