// Histogram, Allan deviation and spectrum of the latest samples of a channel.

import { $, digits, make } from "./page.js";
import { css } from "./plots.js";

const KINDS = {
  histogram: { title: (m) => `histogram, ${m.unit} from the mean`, log: false },
  allan: { title: (m) => `Allan deviation, ${m.unit}, against s`, log: true },
  spectrum: { title: (m) => `amplitude density, ${m.unit}/\u221aHz, against Hz`, log: true },
};
let charts = [], latest = null;

export function show(message) {
  latest = message;
  for (const chart of charts) chart.destroy();
  $("#moments").textContent = `${message.count} samples at ${digits(1 / message.step_s)} Hz: mean ${digits(message.mean)} ${message.unit}, standard deviation ${digits(message.std)} ${message.unit}`;
  $("#charts").replaceChildren();
  const boxes = Object.entries(KINDS).map(([name, kind]) => make("div",
    { role: "img", "aria-label": kind.title(message), "data-chart": name }, make("div", { class: "quiet" }, kind.title(message))));
  $("#charts").append(...boxes); // all of them, so that each has its width
  charts = Object.entries(KINDS).map(([name, kind], i) => chart(name, kind, message, boxes[i]));
}

export const repaint = () => latest && show(latest); // in the colours of another theme

function chart(name, kind, message, box) {
  const { x, y } = message[name];
  const axis = { stroke: css("--quiet"), grid: { stroke: css("--grid") }, ticks: { stroke: css("--grid") } };
  const scale = kind.log ? { distr: 3 } : {};
  const power = (_, v) => v.map((n) => (n === null || n === undefined ? "" : kind.log && Math.abs(Math.log10(n) % 1) > 1e-6 ? "" : String(+n.toPrecision(3))));
  return new uPlot({
    width: Math.max(200, box.clientWidth), height: 180, legend: { show: false }, pxAlign: false,
    scales: { x: { time: false, ...scale }, y: scale },
    axes: [{ ...axis, size: 30, ...(kind.log ? { values: power } : {}) }, { ...axis, size: 70, ...(kind.log ? { values: power } : {}) }],
    series: [{}, { stroke: css("--mark"), width: 1, points: { show: false }, ...(name === "histogram" ? { paths: uPlot.paths.stepped({ align: 0 }), fill: css("--band") } : {}) }],
  }, [x, kind.log ? y.map((v) => (v > 0 ? v : null)) : y], box);
}
