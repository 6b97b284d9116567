// Pictures of the page's own, as SVG. Angles go clockwise from the top, as on a dial.

const SPACE = "http://www.w3.org/2000/svg";

export function svg(name, attributes = {}, ...children) {
  const element = document.createElementNS(SPACE, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

export function picture(kind, box, ...children) {
  return svg("svg", { class: `drawn ${kind}`, viewBox: box, role: "img", "aria-label": kind }, ...children);
}

export const text = (x, y, words, kind = "", anchor = "middle") => svg("text", { x, y, class: kind, "text-anchor": anchor }, words);

export function onDial(radius, deg) {
  const angle = (deg * Math.PI) / 180;
  return [radius * Math.sin(angle), -radius * Math.cos(angle)];
}

export function spoke(inner, outer, deg, kind) {
  const [x1, y1] = onDial(inner, deg), [x2, y2] = onDial(outer, deg);
  return svg("line", { x1, y1, x2, y2, class: kind });
}

export function arcPath(radius, from, to) {
  const [x1, y1] = onDial(radius, from), [x2, y2] = onDial(radius, to);
  return `M${x1} ${y1}A${radius} ${radius} 0 ${Math.abs(to - from) > 180 ? 1 : 0} ${to > from ? 1 : 0} ${x2} ${y2}`;
}

// A full circle of degrees: a mark each 10, a longer one each 30, numbers or names at `named`.
export function ring(radius, named) {
  const marks = Array.from({ length: 36 }, (_, k) => spoke(radius - (k % 3 ? 4 : 8), radius, 10 * k, "scale"));
  const names = Object.entries(named).map(([deg, name]) => { const [x, y] = onDial(radius + (deg % 180 ? 13 : 10), Number(deg)); return text(x, y + 4, name, "name"); });
  return [svg("circle", { r: radius, class: "plate" }), ...marks, ...names];
}

// Round numbers from low to high, about `count` of them.
export function roundMarks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough);
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, k) => +((first + k) * step).toPrecision(12));
}
