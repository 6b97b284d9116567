"""report.html and result.json of a campaign: the article's claims, tables, pictures, and how well the chains agree."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from psabench.campaign import chains, claims, plots
from psabench.campaign.cases import STUDIES, Case, Study
from psabench.campaign.claims import Check, Claim, Figures, Found, HoldFigures
from psabench.campaign.store import Rows
from psabench.report.grading import aligned
from psabench.report.page import figure, section, verdict_line, whole_page, write_report
from psabench.report.page import table as html_table

TITLE = "Gyrocompassing: a campaign"
FORMAT = 1  # of result.json
FIRST_ORDER_DEG = 5.0
COLUMNS = ("platform rms", "p95", "largest", "heading rms", "p95", "≤ 0.1°", "drift rms", "p95")
UNITS = ("deg", "deg", "deg", "deg", "deg", "%", "deg/h", "deg/h")
HOLD_COLUMNS = ("end rms", "p95", "largest on the way, p95", "≤ 0.3°", "≤ 0.5°")
HOLD_UNITS = ("deg", "deg", "deg", "%", "%")


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """The same set-up through two chains: two-sample Kolmogorov-Smirnov of the heading errors."""

    case: Case
    chain: str
    runs: int
    reference_runs: int
    statistic: float
    p: float
    rms_deg: float
    reference_rms_deg: float
    figure: str  # SVG

    def same(self, of: int) -> bool:
        """Whether the chains agree, when there are `of` comparisons."""
        return self.p > chains.KS_P / of


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """All that a report shows; the rows stay in the store."""

    facts: Mapping[str, str]
    cases: Sequence[Case]
    found: Found
    claims: Sequence[Claim]
    checks: Sequence[Check]
    agreements: Sequence[Agreement]
    distribution: str  # SVG, empty without the readings
    # Of the first runs of each case that gave no heading, and that gave one in doubt: why, and how many runs each.
    refusals: Mapping[str, int] = field(default_factory=dict)
    doubts: Mapping[str, int] = field(default_factory=dict)

    @property
    def within(self) -> bool:
        return claims.within_limits(self.checks) and self.same == len(self.agreements)

    @property
    def same(self) -> int:
        """How many comparisons find no difference."""
        return sum(a.same(len(self.agreements)) for a in self.agreements)


def agree(case: Case, chain: str, rows: Rows, reference: Rows) -> Agreement:
    """Compare with the closed form; runs that gave no heading are left out."""
    import numpy as np
    from scipy import stats

    mine, theirs = (r[np.isfinite(r[:, 1]), 1] for r in (rows, reference))
    ks = stats.ks_2samp(mine, theirs, method="asymp") if len(mine) and len(theirs) else None
    both = {chains.CHAINS[chain].title: rows, chains.CHAINS["closed"].title: reference}
    return Agreement(
        case=case,
        chain=chain,
        runs=len(mine),
        reference_runs=len(theirs),
        statistic=math.nan if ks is None else float(ks.statistic),
        p=math.nan if ks is None else float(ks.pvalue),
        rms_deg=claims.Spread.of(mine).rms,
        reference_rms_deg=claims.Spread.of(theirs).rms,
        figure=plots.agreement(f"agreement-{chain}-{case.study}-{case.name}".replace(" ", "-"), both),
    )


def verdict(c: Campaign) -> str:
    """One line."""
    parts = []
    if c.checks:
        kept = sum(x.within for x in c.checks)
        parts.append(f"{kept} of {len(c.checks)} figures lie within their limits")
    if c.agreements:
        parts.append(f"{c.same} of {len(c.agreements)} distributions are the closed form's")
    return f"{'; '.join(parts) or 'no limits apply to these cases'}."


def write(folder: Path, c: Campaign) -> Path:
    """result.json and report.html into `folder`, each whole or not at all; returns the page. Raises as write_report."""
    return write_report(folder, result_dict(c), html_page(c))


def result_dict(c: Campaign) -> dict[str, Any]:
    """For result.json. Numbers that are not finite (a case in which every run was rejected) are null."""
    return {
        "format": FORMAT,
        "facts": dict(c.facts),
        "within_limits": c.within,
        "claims": [asdict(x) for x in c.claims],
        "checks": [_finite(asdict(x)) | {"within": x.within} for x in c.checks],
        "agreements": [
            _finite(
                {
                    "case": a.case.name,
                    "chain": a.chain,
                    "runs": a.runs,
                    "reference_runs": a.reference_runs,
                    "rms_deg": a.rms_deg,
                    "reference_rms_deg": a.reference_rms_deg,
                    "ks": a.statistic,
                    "p": a.p,
                }
            )
            for a in c.agreements
        ],
        "no_heading": dict(c.refusals),
        "in_doubt": dict(c.doubts),
        "cases": [_case_dict(case, c.found[case.study, case.name]) for case in c.cases],
    }


def _case_dict(case: Case, f: Figures | HoldFigures) -> dict[str, Any]:
    told: dict[str, Any] = {"study": case.study, "case": case.name, "title": case.title}
    return told | {"differs": chains.describe(case.setup), "figures": _finite(asdict(f))}


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _finite(v) for k, v in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


# ---- tables, for the console and the page


def row_of(f: Figures | HoldFigures) -> list[str]:
    """A case's figures as text, in the order of COLUMNS or HOLD_COLUMNS."""
    if isinstance(f, HoldFigures):
        kept = [f"{100 * share:.1f}" for share in f.within.values()]
        return [f"{f.end.rms:.3f}", f"{f.end.p95:.3f}", f"{f.largest.p95:.3f}", *kept]
    p, h, d = f.platform, f.heading, f.drift
    errors = [f"{x:.4f}" if math.isfinite(x) else "–" for x in (p.rms, p.p95, p.largest, h.rms, h.p95)]
    return [*errors, f"{100 * f.within_claim:.1f}", f"{d.rms:.3f}", f"{d.p95:.3f}"]


def table(c: Campaign, study: Study) -> list[list[str]]:
    """Head, units, then a row a case."""
    cases = [case for case in c.cases if case.study == study.name]
    hold = cases[0].hold is not None
    head, units = (HOLD_COLUMNS, HOLD_UNITS) if hold else (COLUMNS, UNITS)
    rows = [[_label(case), *row_of(c.found[case.study, case.name])] for case in cases]
    return [["", *head], ["", *units], *rows]


def _label(case: Case) -> str:
    return f"{case.name}: {case.title}" if case.study in ("readings", "improved") else case.name


def console(c: Campaign) -> Iterator[str]:
    """Lines of all tables, then the claims."""
    for study in _studies(c):
        yield study.title
        for line in aligned(table(c, study)):
            yield f"  {line}"
        yield from _too_large(c, study)
    for a in c.agreements:
        runs = f"{a.runs} and {a.reference_runs} runs"
        rms = f"rms {a.rms_deg:.4f} and {a.reference_rms_deg:.4f} deg"
        yield f"{a.case.name}, {a.chain} beside closed: {rms}, KS {a.statistic:.4f}, p {a.p:.3f} ({runs})"
    yield from _failures(c)
    for what, words in _reasons(c):
        yield f"{what}: {words}"
    for x in c.claims:
        yield f"{x.says}: {x.verdict}"
        yield f"  reading   {x.reading}"
        yield f"  honest    {x.honest}"
        yield f"  improved  {x.improved}"
    for check in c.checks:
        if not check.within:
            yield f"out of limits: {check.what}: {check.value:.4g}, wanted {check.low:.4g} to {check.high:.4g}"


def _failures(c: Campaign) -> Iterator[str]:
    """A line a case whose host may have doubts."""
    for case in c.cases:
        f = c.found[case.study, case.name]
        if isinstance(f, Figures) and f.doubted is not None:
            yield f"{case.name}: of {_runs(f.runs)} {f.refused} without a heading, {f.doubted} in doubt"


def _reasons(c: Campaign) -> list[tuple[str, str]]:
    """What became of how many of the first such runs, and why."""
    told = (("no heading", c.refusals), ("in doubt", c.doubts))
    return [(f"{what}, {_runs(count)}", words) for what, found in told for words, count in found.items()]


def _runs(count: int) -> str:
    return f"{count} {'run' if count == 1 else 'runs'}"


def _too_large(c: Campaign, study: Study) -> Iterator[str]:
    """The closed form is of first order: what it says of large errors is reported as such."""
    if c.facts["chain"] != chains.CHAINS["closed"].title:
        return
    for case in c.cases:
        f = c.found[case.study, case.name]
        if case.study == study.name and isinstance(f, Figures) and f.platform.rms > FIRST_ORDER_DEG:
            yield f"  {case.name}: errors so large are beyond the closed form, which is of first order: --chain samples"


def _studies(c: Campaign) -> list[Study]:
    there = {case.study for case in c.cases}
    return [s for s in STUDIES.values() if s.name in there]


# ---- the page


def html_page(c: Campaign) -> str:
    """The whole page. Same input, same bytes."""
    body = [
        verdict_line(verdict(c), c.within),
        _claims(c),
        _agreements(c),
        _distribution(c),
        *(_study(c, s) for s in _studies(c)),
        _failed(c),
        _checks(c),
    ]
    return whole_page(TITLE, c.facts, body)


def _claims(c: Campaign) -> str:
    if not c.claims:
        return ""
    head = ["the article", "kindest reading", "honest", "improved", "verdict"]
    rows = [[x.says, x.reading, x.honest, x.improved, x.verdict] for x in c.claims]
    return section("The article's claims", html_table([head, *rows], numeric=False))


def _agreements(c: Campaign) -> str:
    pictures = [
        figure(
            a.figure,
            f"{escape(a.case.name)}, {escape(a.chain)}: {a.runs} runs beside {a.reference_runs}, "
            f"KS {a.statistic:.4f}, p {a.p:.3f}.",
        )
        for a in c.agreements
    ]
    return section("Agreement of the chains", *pictures) if pictures else ""


def _distribution(c: Campaign) -> str:
    if not c.distribution:
        return ""
    caption = "R0 literal, R5n the kindest reading, R11+ with the common 6′, improved procedure."
    return section("Error of heading beside the claim", figure(c.distribution, caption))


def _study(c: Campaign, study: Study) -> str:
    return section(study.title, html_table(table(c, study), 2), figure(picture(c, study)))


def picture(c: Campaign, study: Study) -> str:
    """SVG of a study."""
    cases = [case for case in c.cases if case.study == study.name]
    found = {case.name: c.found[case.study, case.name] for case in cases}
    held = {name: f for name, f in found.items() if isinstance(f, HoldFigures)}
    compass = {name: f for name, f in found.items() if isinstance(f, Figures)}
    if held:
        return plots.held(cases, held)
    return plots.scan(study, cases, compass) if study.axis else plots.bars(study.name, cases, compass)


def _failed(c: Campaign) -> str:
    """Runs without a heading, and headings that the host's procedure doubts."""
    cases = [f"<p>{escape(line)}.</p>" for line in _failures(c)]
    reasons = html_table([("first runs", "reason"), *_reasons(c)], numeric=False) if _reasons(c) else ""
    return section("No heading, or one in doubt", *cases, reasons) if cases else ""


def _checks(c: Campaign) -> str:
    if not c.checks:
        return ""
    rows = [[x.what, f"{x.value:.4g}", f"{x.low:.4g}", f"{x.high:.4g}", "" if x.within else "out"] for x in c.checks]
    return section("Limits", html_table([["", "value", "from", "to", ""], *rows]))
