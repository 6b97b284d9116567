"""`expect angle_deg = 30 +- 0.01`: a check of the latest result, which makes a session a test."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from psabench.errors import expected
from psabench.shell.lexer import Wrong, split

_FORM = re.compile(r"(?P<path>\S+)\s+(?P<op>=|!=|<=|>=|<|>)\s+(?P<value>.+?)(?:\s+\+-\s+(?P<within>\S+))?\s*")
_OPS: Mapping[str, Callable[[Any, Any], bool]] = {
    "=": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
USAGE = "FIELD = VALUE [+- TOLERANCE], also != < <= > >=; a field inside another with a dot, in a list by its number"


@dataclass(frozen=True, slots=True)
class Expectation:
    """What must hold of the latest result."""

    path: str
    op: str
    value: float | bool | str
    within: float | None

    @classmethod
    def parse(cls, text: str) -> Expectation:
        """Raises Wrong."""
        said = split(text)
        m = _FORM.fullmatch(text[: said[-1].end] if said else "")  # without a comment
        if not m:
            raise Wrong(expected(USAGE, repr(text), "expect"))
        value = literal(m["value"])
        within = literal(m["within"]) if m["within"] else None
        number = _is_number(value) and (within is None or _is_number(within))
        if (within is not None and (m["op"] != "=" or not number)) or (
            m["op"] in "<=>=" and m["op"] != "=" and not number
        ):
            raise Wrong(expected(f"a number after {m['op']}; +- with = and numbers only", repr(text), "expect"))
        return cls(m["path"], m["op"], value, float(within) if within is not None else None)

    def failure(self, result: Mapping[str, Any]) -> str:
        """What does not hold; "" if all is well. A result without the field fails as well."""
        try:
            got: Any = look(result, self.path)
            got = literal(got) if isinstance(got, str) else got  # 56h of a register is a number here as well
        except KeyError as e:
            return f"{self.path}: {e.args[0]}"
        if self.within is not None:
            held = _is_number(got) and abs(got - float(self.value)) <= self.within
        elif _is_number(self.value) != _is_number(got) and self.op not in ("=", "!="):
            held = False
        else:
            held = _OPS[self.op](got, self.value)
        if held:
            return ""
        wanted = f"{self.op} {_shown(self.value)}" + (f" +- {self.within:g}" if self.within is not None else "")
        return f"{self.path} is {_shown(got)}, expected {wanted}"


def literal(text: str) -> float | bool | str:
    """A number, true or false, or text (with or without quotes)."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return float(int(text[:-1], 16)) if re.fullmatch(r"[0-9A-Fa-f]+h", text) else float(text)
    except ValueError:
        return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def look(result: Any, path: str) -> Any:
    """The field of a result. Raises KeyError with what there is instead."""
    here = result
    for step in path.split("."):
        if isinstance(here, Mapping) and step in here:
            here = here[step]
        elif isinstance(here, list) and step.isdecimal() and int(step) < len(here):
            here = here[int(step)]
        elif isinstance(here, Mapping):
            raise KeyError(expected(", ".join(map(str, here)) or "no field", step, "latest result"))
        else:
            raise KeyError(expected("no further field", step, "latest result"))
    return here


def _is_number(x: object) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool)


def _shown(x: object) -> str:
    if isinstance(x, bool):
        return "true" if x else "false"
    return f"{x:.12g}" if isinstance(x, int | float) else str(x)
