// A window of lines as a picture: frames and their words, edges below them, time with its unit.

import { roundMarks, svg, text } from "./svg.js";

export const LEFT = 84;
const TOP = 46, ROW = 26, HIGH = 15, LETTER = 6.3, FOOT = 34;
const UNITS = [[1e9, "s"], [1e6, "ms"], [1e3, "us"], [1, "ns"]];

export function draw(holder, w, at, now, what) {
  const width = Math.max(150, holder.clientWidth), height = TOP + ROW * w.lines.length + FOOT;
  const scale = (width - LEFT) / (w.to_ns - w.from_ns), x = (t) => LEFT + (Math.min(Math.max(t, w.from_ns), w.to_ns) - w.from_ns) * scale;
  holder.setAttribute("height", height);
  holder.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const parts = [...axis(w, x, height), ...frames(w, x, at, what), ...w.lines.flatMap((line, k) => row(line, w, x, TOP + ROW * (k + 1) - 6))];
  if (now >= w.from_ns && now <= w.to_ns) parts.push(svg("line", { x1: x(now), x2: x(now), y1: 2, y2: height - FOOT, class: "now" }));
  holder.replaceChildren(...parts);
}

function axis(w, x, height) {
  const span = w.to_ns - w.from_ns, [factor, unit] = UNITS.find(([f]) => span >= 2 * f) || UNITS[3];
  const marks = roundMarks(0, span / factor, Math.max(2, Math.round((x(w.to_ns) - LEFT) / 110)));
  const y = height - FOOT;
  return [...marks.flatMap((m) => {
    const at = x(w.from_ns + m * factor);
    return [svg("line", { x1: at, x2: at, y1: TOP - 2, y2: y, class: "grid" }), text(at, y + 13, `+${m} ${unit}`, "quiet")];
  }), text(LEFT, y + 28, `window from ${(w.from_ns / 1e9).toFixed(9)} s, ${+(span / factor).toPrecision(6)} ${unit} long`, "quiet", "start")];
}

function frames(w, x, at, what) {
  const marks = w.wrong.map((t) => svg("line", { x1: x(t), x2: x(t), y1: 2, y2: 20, class: "wrong" }));
  if (!w.frames.length) return [text(4, 15, `${what}s`, "name", "start"), text(LEFT + 4, 15, w.seen ? `${w.seen}: zoom in to read them` : "none", "quiet", "start"), ...marks];
  const found = [text(4, 15, `${what}s`, "name", "start"), text(4, 37, "words", "name", "start")];
  for (const f of w.frames) {
    found.push(...tag(x, f.begin_ns, f.end_ns, 3, f.wrong || String(f.place), `frame-tag${f.wrong ? " wrong" : ""}${at && at.place === f.place ? " at" : ""}`));
    found.push(...f.words.flatMap((word) => tag(x, word.begin_ns, word.end_ns, 25, word.text, "word-tag")));
  }
  return found;
}

function tag(x, begin, end, y, words, kind) {
  const a = x(begin), b = Math.max(x(end), a + 1);
  if (b <= LEFT || x(begin) === x(end) && b - a <= 1) return [];
  const box = svg("rect", { x: a, y, width: b - a, height: 18, class: kind });
  box.append(svg("title", {}, words));
  return words.length * LETTER < b - a ? [box, text((a + b) / 2, y + 13, words, `${kind} letters`)] : [box];
}

function row(line, w, x, y) {
  const path = line.columns === undefined ? edges(line, w, x, y) : envelope(line, w, x, y);
  return [text(4, y - 3, line.name, "name", "start"), svg("path", { d: path, class: line.columns === undefined ? "wave" : "wave dense", "data-line": line.name, "data-edges": line.edges })];
}

function edges(line, w, x, y) {
  let level = line.level, d = `M${LEFT} ${y - HIGH * level}`;
  for (const t of line.t_ns) {
    const at = x(t).toFixed(2);
    level = 1 - level;
    d += `H${at}V${y - HIGH * level}`;
  }
  return `${d}H${x(w.to_ns)}`;
}

// A column in which the line moves is drawn from low to high.
function envelope(line, w, x, y) {
  const step = (x(w.to_ns) - LEFT) / line.columns.length;
  return [...line.columns].map((c, k) => {
    const a = (LEFT + k * step).toFixed(2);
    return c === "2" ? `M${a} ${y}V${y - HIGH}` : `M${a} ${y - HIGH * Number(c)}h${step.toFixed(2)}`;
  }).join("");
}
