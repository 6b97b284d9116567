"""report.html (one file, nothing loaded from elsewhere), result.json and the console table of a calibration.

folder = Path("build/run")
write(folder, [Section(label="quiet", result=r, truth=truth)], facts={"seed": "7"})
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from psabench.errors import expected
from psabench.estimate.uncertainty import Estimate
from psabench.procedures.command_line.offered import ON_THE_HEAD
from psabench.procedures.result import LIMIT_CI
from psabench.report.grading import (
    Graded,
    Section,
    as_ratio,
    console_table,
    grade,
    result_dict,
    verdict,
    with_ci,
    within_limits,
)
from psabench.report.nominal import Nominal, nominal_dict, nominal_section
from psabench.report.page import bullets, figure, folded, html_table, section, verdict_line, whole_page, write_report
from psabench.report.quantities import DAGGER as _DAGGER
from psabench.report.quantities import symbol_html as _symbol

__all__ = ["Section", "console_table", "html_page", "within_limits", "write"]

FORMAT = 1  # of result.json


def write(
    folder: Path,
    sections: Sequence[Section],
    facts: Mapping[str, str] | None = None,
    nominal: Nominal | None = None,
    *,
    more: str = "",
    data: Mapping[str, object] | None = None,
) -> Path:
    """Write report.html and result.json into `folder` (made when missing), each whole or not at all.

    Returns the page. `facts` (seed, profile, version...) go into both as they are; nominal: what the sensor is said to
    be. more: a section after the verdict; data: what of it goes into result.json. Raises ValueError for no section,
    OSError and OutputError from the disk.
    """
    if not sections:
        raise ValueError(expected("at least one section", "none", "report"))
    facts = facts or {}
    whole = {
        "format": FORMAT,
        "facts": dict(facts),
        "within_limits": within_limits(sections),
        "nominal": nominal_dict(nominal),
        "sections": [result_dict(s) for s in sections],
        **(data or {}),
    }
    return write_report(folder, whole, html_page(sections, facts, nominal, more))


def html_page(
    sections: Sequence[Section], facts: Mapping[str, str], nominal: Nominal | None = None, more: str = ""
) -> str:
    """The whole page. Same input, same bytes."""
    body = [
        _verdict(sections),
        *([more] if more else []),
        nominal_section(sections, nominal),
        _alpha0(sections, nominal),
        *(_section(s, f"f{i}") for i, s in enumerate(sections)),
        _method(),
    ]
    return whole_page("Accelerometer calibration", facts, body)


def _verdict(sections: Sequence[Section]) -> str:
    compared = [g for s in sections for g in grade(s) if g.within is not None]
    return verdict_line(verdict(sections), within_limits(sections) if compared else None)


def _alpha0(sections: Sequence[Section], nominal: Nominal | None) -> str:
    from psabench.report import plots as report_plots  # matplotlib takes a second: the shell and --help do without

    picture = report_plots.alpha0_figure(sections, nominal)
    if picture is None:
        return ""
    caption = "Green: identifiable. Orange: flagged. Dashed: the truth, or the nominal value where there is none."
    return section("The mounting error α₀, each value with its U", figure(report_plots.svg(picture, "alpha0"), caption))


def _section(s: Section, ident: str) -> str:
    from psabench.report import plots as report_plots

    r = s.result
    pictures = [figure(report_plots.svg(report_plots.turn_figure(s), ident + "turn"))]
    if r.procedure == "fourier":
        second = report_plots.svg(report_plots.second_harmonic_figure(s), ident + "second")
        caption = (
            "Residual without zero and first harmonic. "
            "From one face α<sub>0</sub> is half the arc tangent of the ratio of these two amplitudes."
        )
        pictures.append(figure(second, caption))
    facts = [
        f"channel <b>{escape(r.axis)}</b>",
        f"<b>{len(r.readings)}</b> readings in <b>{r.duration_s:.4g} s</b> of bench time",
        f"residual <b>{r.residual_rms_v * 1e6:.4g} µV</b> rms",
    ]
    if r.drift is not None:
        facts.append(f"drift of the zero <b>{r.drift.value * 1e6:.3g} ± {r.drift.ci_half * 1e6:.2g} µV/s</b>")
    return section(
        s.title,
        f"<p class=facts>{escape(ON_THE_HEAD[r.procedure])}<br>{' · '.join(facts)}</p>",
        _estimates(s),
        _budget_table(s),
        bullets([*(f"<span class=bad>{escape(d)}</span>" for d in r.doubts), *(_symbol(escape(n)) for n in r.notes)]),
        *pictures,
        _correlation(s),
    )


def _estimates(s: Section) -> str:
    truth_head = "<th>truth</th><th>error</th><th>z</th><th>E<sub>n</sub></th>" if s.truth is not None else ""
    head = f"<tr><th></th><th>estimate</th><th>U</th><th>unit</th><th>in SI</th>{truth_head}<th></th></tr>"
    rows = "".join(_estimate_row(g, s.truth is not None, s.result.g_mps2) for g in grade(s))
    why = [
        f"{_DAGGER} {_symbol(e.symbol)} not identifiable: {_symbol(escape(e.reason))}"
        for e in s.result.estimates
        if e.reason
    ]
    return html_table(head, rows, "est") + bullets(why)


def _estimate_row(g: Graded, with_truth: bool, g_mps2: float) -> str:
    e = g.estimate
    value, ci = with_ci(e.value, e.ci_half)
    truth = ""
    if with_truth:
        cells = (
            "" if g.truth is None else f"{g.truth:.7g}",
            "" if g.error is None else f"{g.error:+.2g}",
            as_ratio(g.z, 1),
            as_ratio(g.en, 2),
        )
        truth = "".join(f"<td class=num>{c}</td>" for c in cells)
    mark = "<span class=bad>out of limits</span>" if g.within is False else ""
    kind, flag = ("", "") if e.identifiable else (" class=off", _DAGGER)
    return (
        f"<tr{kind}><th>{_symbol(e.symbol)}{flag}</th><td class=num>{value}</td>"
        f"<td class=num>{ci}</td><td class=unit>{e.unit}</td><td class='num si'>{_si(e.value, e.unit, g_mps2)}</td>"
        f"{truth}<td class=mark>{mark}</td></tr>"
    )


def _budget_table(s: Section) -> str:
    """Components of each estimate's uncertainty; "" where no budget was made."""
    rows = [e for e in s.result.estimates if e.budget]
    names = list(dict.fromkeys(c.name for e in rows for c in e.budget))
    head = "".join(f"<th>{escape(n)}</th>" for n in (*names, "u", "degrees of freedom", "k", "U", "unit"))
    body = "".join(f"<tr><th>{_symbol(e.symbol)}</th>{_budget_cells(e, names)}</tr>" for e in rows)
    text = "Uncertainty budget: standard uncertainties by cause, combined u, expanded U = k u"
    return folded(text, html_table(f"<tr><th></th>{head}</tr>", body)) if rows else ""


def _budget_cells(e: Estimate, names: Sequence[str]) -> str:
    of = {c.name: c.u for c in e.budget}
    dof = f"{e.dof:.0f}" if e.dof < 1e4 else "∞"
    cells = (*(f"{of.get(n, 0.0):.2g}" for n in names), f"{e.sd:.2g}", dof)
    k = e.ci_half / e.sd if e.sd > 0.0 else 0.0
    numbers = "".join(f"<td class=num>{c}</td>" for c in (*cells, f"{k:.2f}", f"{e.ci_half:.2g}"))
    return f"{numbers}<td class=unit>{e.unit}</td>"


def _si(value: float, unit: str, g_mps2: float) -> str:
    if unit == "V/g":
        return f"{value / g_mps2 * 1e3:.6g} mV/(m/s²)"
    if unit == "V/g²":
        return f"{value / g_mps2**2 * 1e6:.4g} µV/(m/s²)²"
    return ""


def _correlation(s: Section) -> str:
    c = s.result.correlation
    symbols = {e.name: _symbol(e.symbol) for e in s.result.estimates}
    head = "".join(f"<th>{symbols[n]}</th>" for n in c.names)
    rows = "".join(
        f"<tr><th>{symbols[n]}</th>{''.join(_correlation_cell(float(v)) for v in row)}</tr>"
        for n, row in zip(c.names, c.matrix, strict=True)
    )
    return folded("Correlation of the estimates", html_table(f"<tr><th></th>{head}</tr>", rows))


def _correlation_cell(v: float) -> str:
    shade = round(abs(v) * 55)
    ground = "var(--s1)" if v < 0 else "var(--s2)"
    style = f"background:color-mix(in srgb, {ground} {shade}%, transparent)"
    return f'<td class=num style="{style}">{v:+.3f}</td>'


def _method() -> str:
    return section(
        "How to read this",
        "<p>Voltages are at the load resistor, less the known gain of the converter's filter; coefficients are per "
        "local g. U is the expanded uncertainty (GUM, 95.45 %, k = 2 for many degrees of freedom): the scatter of the "
        "readings by the delta method, and what no reading shows (chain, temperature, head, resolution) by the "
        "estimator's own sensitivities. The truth is exact: z = error/u, E<sub>n</sub> = error/U. "
        f"A number is out of limits beyond {LIMIT_CI:g} U. "
        "u<sub>0</sub> contains the quadratic terms that no turn in 1 g can take out of it.</p>"
        "<p>Repairs to the article: position 1 of its fig. 2 has a<sub>x</sub> = +g; "
        "(17) needs least squares (80 × 5); "
        "k<sub>xy</sub> of (18) takes the sign of C<sub>3</sub>; "
        "α<sub>0</sub> = ½ atan(C<sub>4</sub>/C<sub>3</sub>), not atan2.</p>",
        kind="method",
    )
