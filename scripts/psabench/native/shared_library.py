"""A shared library of ours as ctypes sees it: found, its ABI checked, its functions declared."""

from __future__ import annotations

import ctypes as c
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from psabench.errors import BadInput, expected
from psabench.places import find_library
from psabench.report.provenance import note_library


class SharedLibrary:
    """The functions of a header, each under its name without the prefix, with their C types checked by ctypes."""

    abi: ClassVar[int]  # of the header that the prototypes were written from
    prefix: ClassVar[str]  # of all functions
    variable: ClassVar[str]  # of the environment: names another library
    prototypes: ClassVar[Mapping[str, tuple[Any, ...]]]  # by name without prefix: what it returns, what it takes

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            so = c.CDLL(path)
        except OSError as e:
            raise BadInput(expected(f"a shared library ({self.variable} names another)", e, path)) from None
        try:
            abi = int(getattr(so, f"{self.prefix}abi")())
            if abi != self.abi:
                raise BadInput(expected(f"ABI {self.abi} ({self.variable} names another library)", abi, path))
            for name, (result, *arguments) in self.prototypes.items():
                function = getattr(so, self.prefix + name)
                function.restype, function.argtypes = result, arguments
                setattr(self, name, function)
        except AttributeError as e:
            raise BadInput(expected(f"a library of this version (or {self.variable})", e, path)) from None

    def __getattr__(self, name: str) -> Any:  # for the type checker: __init__ has set them all
        raise AttributeError(name)

    @classmethod
    def load(cls, name: str) -> Self:
        """The library of that file name. Raises BadInput when it is nowhere or of another ABI."""
        path = find_library(name, cls.variable)
        if path is not None:
            note_library(name, path)
            return cls(str(path))
        try:
            return cls(name)
        except BadInput:
            raise BadInput(expected("a library here or in the system (make builds it)", "none", name)) from None
