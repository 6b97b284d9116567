// The gyro unit: platform, heading and drift as the unit itself reports them. Angles and rates come with its readings;
// the azimuth angle and the drift that it compensates are objects, asked when the page says so.

import { $, digits } from "./page.js";
import { css, size } from "./plots.js";
import { picture, ring, spoke, svg, text } from "./svg.js";

const TITLE = "GYRO";
const ASKED = [["azimuth angle", "2106h 1", "deg"], ["heading", "2106h 2", "deg"], ["drift 1", "2107h 1", "deg/h"], ["drift 2", "2107h 2", "deg/h"]];
const FLAGS = ["SATURATED", "LEVEL_LOST", "ENCODER_FAULT", "NOT_SETTLED"];
const RANGES_ARCMIN = [10, 60, 600]; // of the level
const EVERY_S = 0.1, MOST = 1200; // points of the drift; when there are more every second one goes

let choices = {}, azimuth_deg = null, said = "", kept = [], every_s = EVERY_S, mode = null, chart = null, drawn = null;

export function offer(hello, say) {
  const unit = hello.units.find((u) => u.name === hello.unit);
  $("#gyro").hidden = unit?.board !== TITLE;
  if ($("#gyro").hidden) return;
  choices = hello.choices;
  azimuth_deg = null;
  said = "";
  drawn = { gimbal: gimbal(), level: level(), rose: rose() };
  $("#gyro-pictures").replaceChildren(...Object.values(drawn).map((d) => d.picture));
  forget();
  $("#gyro-ask").onclick = () => ask(say);
}

async function ask(say) {
  const words = [];
  for (const [name, where, unit] of ASKED) {
    const answer = await say(`dut.object ${where}`, true);
    if (!answer) return;
    if (name === "azimuth angle") azimuth_deg = answer.result.value;
    words.push(`${name} ${digits(answer.result.value)} ${unit}`);
    said = `the unit at ${answer.time.t_s.toFixed(1)} s: ${words.join(", ")}`;
  }
  forget();
}

function forget() {
  kept = [];
  every_s = EVERY_S;
  if (chart) chart.destroy();
  chart = null;
}

const wrapped = (deg, from) => ((((deg - from) % 360) + 360) % 360) + from;

export function feed(fresh) {
  if ($("#gyro").hidden || !fresh || !fresh.names.includes("ENCODER")) return;
  const column = (name) => fresh.bands[fresh.names.indexOf(name)][2];
  const last = Object.fromEntries(fresh.names.map((name) => [name, column(name).at(-1)]));
  if (Math.round(last.MODE) !== mode) { mode = Math.round(last.MODE); forget(); }
  drawn.gimbal(last);
  drawn.level(last);
  drawn.rose(azimuth_deg === null ? null : wrapped(last.ENCODER - azimuth_deg, 0));
  const flags = FLAGS.filter((f) => last[f] > 0);
  $("#gyro-state").textContent = `mode ${word("MODE", last)}, ${word("PHASE", last)}, position ${Math.round(last.POSITION)}, `
    + `${flags.length ? flags.join(", ") : "no flag"}; U1 ${digits(last.U1)}, U2 ${digits(last.U2)} deg/h`;
  if (azimuth_deg === null) { $("#gyro-heading").textContent = "heading: ask the unit for its azimuth angle first"; return; }
  column("ENCODER").forEach((q, k) => { if (q !== null) keep(fresh.t[k], wrapped(q - azimuth_deg, 0)); });
  drift();
}

// Only where the switch of the truth is on, and as long as it is.
export function truth(state) {
  const shown = !$("#gyro").hidden && state?.platform && state.vehicle;
  $("#gyro-truth").hidden = !shown;
  if (!shown) return;
  const { vehicle, platform } = state;
  $("#gyro-truth").textContent = `truth: heading of the vehicle ${digits(vehicle.heading_deg)} deg, azimuth angle ${digits(platform.alpha_deg)} deg, `
    + `drift ${platform.drift_degph.map((d) => digits(+d.toPrecision(4))).join(", ")} deg/h`;
}

const word = (name, last) => choices[name]?.[Math.round(last[name])] ?? Math.round(last[name]);

function keep(t_s, heading_deg) {
  if (kept.length && t_s < kept.at(-1)[0]) forget(); // time went back
  if (kept.length && t_s < kept.at(-1)[0] + every_s) return;
  kept.push([t_s, kept.length ? wrapped(heading_deg, kept.at(-1)[1] - 180) : heading_deg]);
  if (kept.length > MOST) { kept = kept.filter((_, k) => k % 2 === 0); every_s *= 2; }
}

function drift() {
  if (kept.length < 2) return;
  const t = kept.map(([t_s]) => t_s), moved = kept.map(([, deg]) => 60 * (deg - kept[0][1]));
  $("#gyro-heading").textContent = `heading ${wrapped(kept.at(-1)[1], 0).toFixed(3)} deg, drift ${digits(+slope(t, moved).toPrecision(3))} deg/h`
    + ` over ${digits(+(t.at(-1) - t[0]).toFixed(1))} s; ${said}`;
  if (!chart) chart = new uPlot(driftPlot(), [t, moved], $("#gyro-drift"));
  else chart.setData([t, moved]);
}

export function repaint() { // in the colours of another theme
  chart?.destroy();
  chart = null;
  drift();
}

// Least squares: arc minutes a second are degrees a minute.
function slope(t, moved) {
  const mean = (x) => x.reduce((a, b) => a + b, 0) / x.length, t0 = mean(t), m0 = mean(moved);
  const both = t.reduce((sum, x, k) => sum + (x - t0) * (moved[k] - m0), 0), square = t.reduce((sum, x) => sum + (x - t0) ** 2, 0);
  return (60 * both) / square;
}

function driftPlot() {
  const axis = { stroke: css("--quiet"), grid: { stroke: css("--grid") }, ticks: { stroke: css("--grid") } };
  return {
    width: size($("#gyro-drift")), height: 120, pxAlign: false, legend: { show: false }, scales: { x: { time: false } },
    axes: [{ ...axis, size: 28 }, { ...axis, size: 70, values: (_, v) => v.map((x) => +x.toPrecision(5)) }],
    series: [{ label: "s" }, { stroke: css("--mark"), width: 1, points: { show: false }, label: "arcmin" }],
  };
}

const withPicture = (drawing, show) => Object.assign(show, { picture: drawing });

// Seen from above: q is counter-clockwise from the vehicle's nose.
function gimbal() {
  const plate = svg("g", { class: "turning" }, svg("circle", { r: 46, class: "disc" }), svg("path", { class: "hand", d: "M-4 10L0 -44L4 10Z" }), spoke(0, 44, 90, "scale"), spoke(0, 44, 270, "scale"));
  const drawing = picture("platform", "-80 -80 160 160", ...ring(58, { 0: "0", 270: "90", 180: "180", 90: "-90" }), plate);
  return withPicture(drawing, (r) => {
    plate.setAttribute("transform", `rotate(${-r.ENCODER})`);
    drawing.setAttribute("aria-label", `platform from above, outer gimbal at ${digits(r.ENCODER)} deg`);
  });
}

// A spirit level: the bubble goes to the side that is high. beta lifts y, gamma lowers x.
function level() {
  const bubble = svg("circle", { r: 7, class: "mark" }), range = text(0, 74, "", "name");
  const drawing = picture("level", "-80 -80 160 160", svg("circle", { r: 58, class: "plate" }), svg("circle", { r: 29, class: "scale" }),
    ...[0, 90, 180, 270].map((deg) => spoke(4, 58, deg, "scale")), text(66, 4, "x", "name"), text(0, -64, "y", "name"), bubble, range);
  return withPicture(drawing, (r) => {
    const [beta, gamma] = [60 * r.BETA, 60 * r.GAMMA], far = Math.hypot(beta, gamma);
    const full = RANGES_ARCMIN.find((m) => far <= m) ?? RANGES_ARCMIN.at(-1), shrunk = Math.min(1, full / Math.max(far, 1e-9)) * (58 / full);
    bubble.setAttribute("transform", `translate(${-gamma * shrunk} ${-beta * shrunk})`);
    range.textContent = `rim ${full} arcmin`;
    drawing.setAttribute("aria-label", `level: beta ${digits(+beta.toFixed(3))}, gamma ${digits(+gamma.toFixed(3))} arcmin`);
  });
}

function rose() {
  const hand = svg("path", { class: "hand", d: "M0 -52L-5 10L0 5L5 10Z" });
  const drawing = picture("heading", "-80 -80 160 160", ...ring(58, { 0: "N", 90: "E", 180: "S", 270: "W" }), hand);
  return withPicture(drawing, (heading_deg) => {
    hand.setAttribute("transform", `rotate(${heading_deg ?? 0})`);
    hand.setAttribute("visibility", heading_deg === null ? "hidden" : "visible");
    drawing.setAttribute("aria-label", heading_deg === null ? "heading: not asked for" : `heading ${heading_deg.toFixed(2)} deg`);
  });
}
