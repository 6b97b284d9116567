// Channels of the chosen unit as rolling plots: the band from the lowest to the highest value, and the mean.

import { $, digits, make } from "./page.js";

const KEPT = 1800, FEW = 6;
let unit = "", names = [], units = [], data = [], plots = [], dirty = false;

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function forget(message) {
  unit = message.unit; names = message.names; units = message.units;
  data = names.map(() => [[], [], [], []]);
  build();
}

export function add(message, all) {
  if (!message || !message.names) { if (all) forget({ unit: "", names: [], units: [] }); return; }
  const back = message.t.length && data.length && data[0][0].length && message.t[0] < data[0][0].at(-1);
  if (all || back || message.unit !== unit || message.names.join() !== names.join()) forget(message);
  data.forEach((columns, k) => {
    columns[0].push(...message.t);
    for (let i = 0; i < 3; i++) columns[i + 1].push(...message.bands[k][i]);
    const over = columns[0].length - KEPT;
    if (over > 0) for (const column of columns) column.splice(0, over);
  });
  dirty = true;
}

export function build() {
  for (const plot of plots) plot.destroy();
  const holder = $("#plots");
  holder.replaceChildren();
  $("#all-channels").parentElement.hidden = names.length <= FEW;
  plots = ($("#all-channels").checked ? names : names.slice(0, FEW)).map((name, k) => {
    const box = make("div", { "data-channel": name, role: "img", "aria-label": `channel ${name}` }, make("div", { class: "quiet" }));
    holder.append(box);
    return new uPlot(settings(name, units[k]), data[k], box);
  });
  dirty = true;
}

function settings(name, physical) {
  const axis = { stroke: css("--quiet"), grid: { stroke: css("--grid") }, ticks: { stroke: css("--grid") } };
  const edge = { stroke: css("--band"), width: 1, points: { show: false } };
  return {
    width: width(), height: names.length > 4 ? 110 : 140, pxAlign: false,
    cursor: { sync: { key: "channels" } },
    legend: { show: false }, scales: { x: { time: false } },
    // 50 px, the default, cut the sign off
    axes: [{ ...axis, size: 28, values: marks }, { ...axis, size: 80, values: marks }],
    series: [{ label: "s" }, { ...edge, label: "min" }, { ...edge, label: "max" },
      { stroke: css("--mark"), width: 1, points: { show: false }, label: `${name}${physical ? `, ${physical}` : ""}` }],
    bands: [{ series: [2, 1], fill: css("--band") }],
  };
}

// Short enough for the axis: codes have ten digits.
const marks = (_, values) => values.map((x) => (Math.abs(x) < 1e7 ? +x.toPrecision(7) : (+x.toPrecision(5)).toExponential()));

export const size = (box) => Math.max(200, box.clientWidth);
const width = () => size($("#plots"));

export function draw() {
  if (!dirty) return;
  dirty = false;
  const span = Number($("#window").value);
  plots.forEach((plot, k) => {
    const t = data[k][0];
    if (!t.length) return;
    const first = t.findIndex((x) => x >= t.at(-1) - span);
    plot.root.previousSibling.textContent = `${names[k]}  ${digits(data[k][3].at(-1))} ${units[k]}`;
    plot.setData(data[k].map((column) => column.slice(first)));
  });
}

export function touch() { dirty = true; }
export function resize() { for (const plot of plots) plot.setSize({ width: width(), height: plot.height }); }
export const shown = () => ({ unit, names, points: data.length ? data[0][0].length : 0, t_s: data.length ? data[0][0].at(-1) ?? 0 : 0, last: data.map((c) => c[3].at(-1)) });
