"""What a sensor is said to be, beside what was found: the article's printed values, a scenario's, a passport's.

The article's table is for the article's sensor alone. Another scenario has its own nominal values, before the spread
of a series is drawn; a real sensor has those of `--passport`, a YAML file with the names of a scenario's axis:

    u0_v: 2.48
    kx_v_per_g: 1.05
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected, input_error
from psabench.estimate.uncertainty import Estimate
from psabench.report.grading import Section, aligned, with_ci
from psabench.report.page import html_table, section
from psabench.report.quantities import DAGGER, symbol_html

# Names of a scenario's axis and of estimates: symbol, unit.
QUANTITIES: Mapping[str, tuple[str, str]] = {
    "u0_v": ("u_0", "V"),
    "alpha0_deg": ("α_0", "deg"),
    "kx_v_per_g": ("k_x", "V/g"),
    "ky_v_per_g": ("k_y", "V/g"),
    "kz_v_per_g": ("k_z", "V/g"),
    "kxy_v_per_g2": ("k_xy", "V/g²"),
    "kxx_v_per_g2": ("k_xx", "V/g²"),
    "kyy_v_per_g2": ("k_yy", "V/g²"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Nominal:
    """Values that a sensor is said to have."""

    source: str  # as the table's heading has it
    values: Mapping[str, str]  # by name, of QUANTITIES, as printed
    digits: bool = False  # what was found is rounded as they are, to be compared with print

    def number(self, name: str) -> float | None:
        """A value; None: it has none of that name."""
        return float(self.values[name]) if name in self.values else None


ARTICLE = Nominal(
    source="the article",
    values={
        "u0_v": "2.50",
        "alpha0_deg": "0.1121",
        "kx_v_per_g": "1.0",
        "ky_v_per_g": "0.0098",
        "kxy_v_per_g2": "0.0010",
    },
    digits=True,
)


def nominal_of_scenario(resolved: Mapping[str, Any], axis: str, node: int, name: str) -> Nominal | None:
    """Of the sensor on an axis of the unit at a node, in a resolved scenario; None: its sensor has no such values.

    The article's sensor is recognised by its values.
    """
    units = resolved.get("units", [])
    unit: Mapping[str, Any] = next((u for u in units if u.get("node") == node), units[0] if units else {})
    sensor = unit.get("axes", {}).get(axis, {})
    if sensor.get("sensor") != "mems":
        return None
    if all(sensor.get(n) == ARTICLE.number(n) for n in ARTICLE.values):
        return ARTICLE
    return Nominal(source=f"scenario {name}", values={n: f"{sensor[n]:.10g}" for n in QUANTITIES if n in sensor})


def read_passport(path: Path) -> Nominal:
    """A passport's values. Raises BadInput for a file that is none, a name that is not known, a value that is none."""
    import yaml

    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as e:
        raise input_error(path, "a passport", e) from e
    if not isinstance(found, dict) or not found:
        raise BadInput(expected("lines NAME: VALUE", found, path))
    for name, value in found.items():
        if name not in QUANTITIES:
            raise BadInput(expected(", ".join(QUANTITIES), name, path))
        if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < float("inf"):
            raise BadInput(expected("a number", value, f"{path}: {name}"))
    return Nominal(source=f"passport {path.name}", values={n: f"{found[n]:.10g}" for n in QUANTITIES if n in found})


def nominal_dict(nominal: Nominal | None) -> dict[str, Any] | None:
    """For result.json and the set-up of a recording."""
    if nominal is None:
        return None
    return {"source": nominal.source, "values": dict(nominal.values), "digits": nominal.digits}


def nominal_of_dict(data: Mapping[str, Any] | None) -> Nominal | None:
    """The reverse."""
    if data is None:
        return None
    values = {str(k): str(v) for k, v in data["values"].items()}
    return Nominal(source=str(data["source"]), values=values, digits=bool(data["digits"]))


def as_printed(value: float, printed: str) -> str:
    """A value with as many decimals as the article prints."""
    return f"{value:.{len(printed.partition('.')[2])}f}"


def _shown_rows(sections: Sequence[Section], nominal: Nominal) -> list[tuple[str, str]]:
    """The article's rows are all shown, of another sensor those that a section has an estimate of."""
    return [(n, text) for n, text in nominal.values.items() if nominal.digits or any(_found_in(s, n) for s in sections)]


def _found_in(s: Section, name: str) -> Estimate | None:
    return next((e for e in s.result.estimates if e.name == name), None)


# ---- the page


def nominal_section(sections: Sequence[Section], nominal: Nominal | None) -> str:
    """A table of the nominal values beside ours; "" without them."""
    if nominal is None:
        return ""
    head = "".join(f"<th>{escape(s.title)}</th>" for s in sections)
    rows = []
    for name, printed in _shown_rows(sections, nominal):
        symbol, unit = QUANTITIES[name]
        cells = "".join(f"<td>{_page_cell(_found_in(s, name), printed, nominal)}</td>" for s in sections)
        first = f"<th>{symbol_html(symbol)}</th><td class=num>{printed}</td><td class=unit>{unit}</td>"
        rows.append(f"<tr>{first}{cells}</tr>")
    title = "printed" if nominal.digits else "nominal"
    return section(
        f"Beside {nominal.source}",
        html_table(f"<tr><th></th><th>{title}</th><th></th>{head}</tr>", "".join(rows), "cmp"),
        f"<p class=small>{_LEGEND[nominal.digits]} {DAGGER} not identifiable from these data.</p>",
    )


_LEGEND = {
    True: "Large: our value with the digits that the article prints (green: the same). Below it: the value with its U.",
    False: "Large: our value. Below it: its U, and the value less the nominal one.",
}


def _page_cell(e: Estimate | None, printed: str, nominal: Nominal) -> str:
    if e is None:
        return "<span class=none>–</span>"
    value, ci = with_ci(e.value, e.ci_half, most=6)
    large, below = value, f"± {ci}; {e.value - float(printed):+.2g}"
    kind = "other"
    if nominal.digits:
        large, below = as_printed(e.value, printed), f"{value} ± {ci}"
        kind = "same" if large == printed else "other"
    flag = "" if e.identifiable else DAGGER
    return f"<span class={kind}>{large}</span>{flag}<br><span class=ci>{below}</span>"


# ---- the console


def console_nominal(sections: Sequence[Section], nominal: Nominal | None) -> str:
    """Lines of the nominal values beside ours; `?` marks what is not identifiable; "" without nominal values."""
    if nominal is None:
        return ""
    rows = [
        ("", "", *(s.result.procedure for s in sections)),
        ("", "printed" if nominal.digits else "nominal", *(s.label for s in sections)),
    ]
    for name, printed in _shown_rows(sections, nominal):
        rows.append((name, printed, *(_console_cell(_found_in(s, name), printed, nominal) for s in sections)))
    how = "with its digits " if nominal.digits else ""
    head = f"beside {nominal.source}, {how}(?: not identifiable from these data)"
    return "".join(f"{line}\n" for line in (head, *(f"  {row}" for row in aligned(rows))))


def _console_cell(e: Estimate | None, printed: str, nominal: Nominal) -> str:
    if e is None:
        return "-"
    value = as_printed(e.value, printed) if nominal.digits else with_ci(e.value, e.ci_half, most=6)[0]
    return value + ("" if e.identifiable else "?")
