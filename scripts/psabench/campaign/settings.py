"""What `--set` takes, in the words of a person who has not read the code: the fields of `Setup` and their ranges.

A value out of its range is rejected by name before anything is computed; what only the algebra sees (positions that
coincide, a latitude that leaves no horizontal rate) it rejects itself, told with the case.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields

from psabench.campaign import chains
from psabench.campaign.cases import Case
from psabench.campaign.chains import Wanted
from psabench.campaign.setup import ANY, CHOICES, Setting, Setup, changed
from psabench.errors import BadInput, expected
from psabench.native.navlib import library

_FOUND = {f.name: f.metadata["setting"] for f in fields(Setup) if f.metadata}
_LAST = ("gm_before_s", "settle_s", "method", "simplified")  # as --list has them: times of waiting after the loops
SETTINGS: Mapping[str, Setting] = {n: _FOUND[n] for n in (*(n for n in _FOUND if n not in _LAST), *_LAST)}


def base(words: Sequence[str], start: Setup | None = None) -> Setup:
    """`start`, else the article's errors, with NAME=VALUE of the command line. Raises BadInput that names the field."""
    setup = start or Setup()
    for word in words:
        name = word.partition("=")[0]
        if near := difflib.get_close_matches(name, SETTINGS, 3) if name not in SETTINGS else []:
            raise BadInput(expected(f"a setting that --list names ({', '.join(near)}?)", name, f"--set {word}"))
        setup = changed(setup, [word])
        if reason := out_of_range(setup, name):
            raise BadInput(f"--set {word}: {reason}")
    return setup


def out_of_range(setup: Setup, name: str) -> str:
    """Why the field's value is rejected, "": it is not."""
    s, value = SETTINGS.get(name, Setting("")), getattr(setup, name)
    if value is None or isinstance(value, str | bool):
        return ""
    if name == "angles_deg" and not 3 <= len(value) <= 64:
        return expected("3 to 64 positions", len(value), name)
    for x in value if isinstance(value, tuple) else (value,):
        if not s.low <= x <= s.high:
            return expected(f"{s.low:g} to {s.high:g}{s.unit and ' '}{s.unit}", f"{x:g}", name)
    return ""


def rehearse(cases: Sequence[Case], words: Sequence[str]) -> None:
    """One run of each case: what the algebra rejects is reported before any worker starts. Raises BadInput."""
    library()  # where there is none, that is no case's fault
    for case in cases:
        try:
            chains.compute([Wanted(chain="closed", setup=case.setup, hold=case.hold, seed=0, first_run=0, runs=1)])
        except BadInput as e:
            told = "".join(f"--set {w}: " for w in words)
            raise BadInput(f"{told}case {case.name}: {e}") from e


def lines() -> Iterator[str]:
    """Of --list: name, the article's value, unit or choices, meaning."""
    plain = Setup()
    shown = {name: f"{name}={_shown(getattr(plain, name))}" for name in SETTINGS}
    width = max(map(len, shown.values()))
    for name, s in SETTINGS.items():
        choices = f" ({', '.join(CHOICES[name])})" if name in CHOICES else ""
        unit = f"{s.unit}; " if s.unit else ""
        yield f"  {shown[name]:{width}}  {unit}{s.about}{choices}"


def setting_rows() -> list[dict[str, object]]:
    """Of --list --json: name, the article's value (null: any), unit, meaning, choices or range."""
    plain = Setup()
    return [
        {
            "name": name,
            "value": getattr(plain, name),
            "unit": s.unit,
            "about": s.about,
            **({"choices": list(CHOICES[name])} if name in CHOICES else {"min": s.low, "max": s.high}),
        }
        for name, s in SETTINGS.items()
    ]


def _shown(value: object) -> str:
    if value is None or isinstance(value, bool):
        return {None: ANY, True: "yes", False: "no"}[value]
    return ",".join(f"{x:g}" for x in value) if isinstance(value, tuple) else f"{value}"
