"""What the article claims, and what was asked for of this fleet, beside what was found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from psabench.koi.fleet.figures import Harm, ModeFigures

FACTORS = {"both": 2.0, "dov": 1.5, "auto": 1.5}  # both: the article's "about twice" (E1); each alone: E0
WITHIN_MILE = {
    "bins": 0.5,
    "good": 0.95,
}  # most flights within a mile: the article's for its units (E1); the shares: E0
HARM = 1.1  # rms and 95th percentile with both by those with neither (E0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One line."""

    what: str
    asked: str
    found: str
    met: bool


def list_claims(modes: Mapping[tuple[str, str], ModeFigures], harms: Sequence[tuple[str, Harm]]) -> Iterator[Claim]:
    """modes: by class and mode; harms: with their class."""
    for (unit_class, mode), f in modes.items():
        if mode in FACTORS:
            yield Claim(
                what=f"{unit_class}: factor, {mode}",
                asked=f">= {FACTORS[mode]:g}",
                found=f.factor.text(),
                met=f.factor.value >= FACTORS[mode],
            )
    for (unit_class, mode), f in modes.items():
        if mode == "both":
            yield Claim(
                what=f"{unit_class}: share of flights within a mile, both",
                asked=f">= {WITHIN_MILE[unit_class]:g}",
                found=f.within_mile.text(),
                met=f.within_mile.value >= WITHIN_MILE[unit_class],
            )
    for unit_class, h in harms:
        yield Claim(
            what=f"{unit_class}: {h.condition}, both by neither",
            asked=f"<= {HARM:g}",
            found=f"rms {h.ratios[0]:.2f}, 95 % {h.ratios[1]:.2f}",
            met=max(h.ratios) <= HARM,
        )
