// Estimates of a procedure that runs: value and 95 % interval against the number of readings.

import { $, digits, make } from "./page.js";
import { css, size } from "./plots.js";

let charts = [], shown = "", latest = [];

export function follow(intervals) {
  latest = intervals;
  const key = intervals.map((e) => e.name).join();
  if (key !== shown) build(intervals, key);
  intervals.forEach((e, k) => {
    const { box, chart } = charts[k], [readings, values, halves] = e.columns, half = halves.at(-1);
    const words = `${e.name} ${rounded(values.at(-1), half)} \u00b1 ${digits(+half.toPrecision(2))} ${e.unit}, ${readings.at(-1)} readings`;
    box.firstChild.textContent = words;
    box.setAttribute("aria-label", words);
    chart.setData([readings, values.map((v, i) => v - halves[i]), values.map((v, i) => v + halves[i]), values]);
  });
}

export function repaint() { // in the colours of another theme
  build(latest, shown);
  follow(latest);
}

function build(intervals, key) {
  for (const { chart } of charts) chart.destroy();
  shown = key;
  const boxes = intervals.map((e) => make("div", { role: "img", "data-estimate": e.name }, make("div", { class: "quiet" })));
  $("#intervals").replaceChildren(...boxes);
  charts = boxes.map((box) => ({ box, chart: new uPlot(settings(box), [[], [], [], []], box) }));
}

// As many digits as the interval has with two of its own.
const rounded = (value, half) => (half > 0 ? value.toFixed(Math.min(12, Math.max(0, 1 - Math.floor(Math.log10(half))))) : digits(value));

// The scale is the latest interval's: an early one, of few readings, is wider than the plot and would hide how it tightens.
const HALVES = 4;
export function range(values, halves) {
  const half = halves.at(-1) * HALVES, value = values.at(-1);
  return half > 0 ? [value - half, value + half] : null;
}

export const scales = () => charts.map(({ chart }) => [chart.scales.y.min, chart.scales.y.max]);  // for tests

const scale = (chart, low, high) => {
  const [, lows, , values] = chart.data;
  return (values.length && range(values, values.map((v, i) => v - lows[i]))) || uPlot.rangeNum(low, high, 0.1, true);
};

function settings(box) {
  const axis = { stroke: css("--quiet"), grid: { stroke: css("--grid") }, ticks: { stroke: css("--grid") } };
  const edge = { stroke: css("--band"), width: 1, points: { show: false } };
  return {
    width: size(box), height: 120, pxAlign: false, legend: { show: false }, scales: { x: { time: false }, y: { range: scale } },
    axes: [{ ...axis, size: 28 }, { ...axis, size: 80, values: (_, v) => v.map((x) => +x.toPrecision(7)) }],
    series: [{}, edge, edge, { stroke: css("--mark"), width: 1, points: { show: true, size: 4 } }],
    bands: [{ series: [2, 1], fill: css("--band") }],
  };
}
