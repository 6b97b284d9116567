// Instruments drawn as instruments: dials of the head and of each axis of the table, thermometer, meter of the supply.
// What is drawn is what the instrument's own readout says, and stands beside it in words.

import { $, digits, make } from "./page.js";
import { commandForm } from "./forms.js";
import { arcPath, onDial, picture, ring, roundMarks, spoke, svg, text } from "./svg.js";

const THINGS = ["head", "table", "chamber", "supply", "vehicle", "gyro"];
const COMPASS = { 0: "0", 90: "90", 180: "180", 270: "270" };
const HAND = "M-4 10L0 -52L4 10Z";
const AHEAD_MIN = 10; // what the ramp does in so many minutes is drawn
const RECENT_S = 10, SHOWN_S = 3; // so long a dip stays on the meter, of the bench's time and of the page's
const CHAMBER_DEGC = [-60, 100], METERS_V = [1, 3, 10, 15, 30, 100, 300, 1000]; // ranges; what goes beyond takes the next
const LONGEST_S = 1; // without a new reading the plate stops turning

let drawn = {}, time_s = 0, dipSeen = new Map();

export function instruments(hello, say) {
  const list = $("#instrument-list");
  drawn = {};
  dipSeen = new Map();
  list.replaceChildren();
  for (const thing of THINGS) {
    const commands = Object.entries(hello.commands).filter(([n]) => n.startsWith(`${thing}.`) && !n.endsWith(".read") && !n.endsWith(".log"));
    if (!commands.length) continue;
    const forms = commands.map(([n, c]) => commandForm(n, c, say));
    if (thing === "vehicle" || thing === "gyro") list.append(make("details", {}, make("summary", {}, thing), ...forms));
    else list.append(make("h3", {}, thing), ...faces(thing, hello), ...forms);
  }
  const absent = THINGS.filter((t) => hello.absent[t]);
  if (absent.length) list.append(make("p", { class: "quiet" }, `Not in this scenario: ${absent.join(", ")}.`));
}

function faces(thing, hello) {
  const makers = {
    head: () => [["head", headDial()]],
    table: () => hello.tables.map((name, k) => [name, tableDial(k + 1)]),
    chamber: () => [["chamber", thermometer()]],
    supply: () => [["supply", voltmeter()]],
  };
  return makers[thing]().map(([name, face]) => {
    drawn[name] = face;
    return make("div", { class: "instrument" }, face.picture, make("p", { class: "quiet", id: `read-${name}` }, "-"));
  });
}

export function readings(state) {
  for (const [name, shown] of Object.entries(state.instruments)) {
    const place = $(`#read-${name}`);
    if (!place) continue;
    place.textContent = Object.entries(shown).map(([k, v]) => `${k} ${digits(v)}`).join(", ");
    drawn[name].show(shown, state.faults);
  }
}

// The bench's time: an axis that turns at a constant rate goes on turning between two readings.
export function turn(t_s) {
  time_s = t_s;
  for (const face of Object.values(drawn)) face.turn?.();
}

const say = (picture, words) => picture.setAttribute("aria-label", words);
const moving = (element, on) => element.classList.toggle("moving", on);

function headDial() {
  const hand = svg("path", { class: "hand", d: HAND }), side = text(0, 34, "", "name");
  const drawing = picture("dividing head", "-80 -80 160 160", ...ring(58, COMPASS), side, hand, svg("circle", { r: 4, class: "pin" }));
  return {
    picture: drawing,
    show(r) {
      hand.setAttribute("transform", `rotate(${r.angle_deg})`);
      moving(hand, !r.at_rest);
      side.textContent = r.face ?? "";
      say(drawing, `dividing head at ${digits(r.angle_deg)} deg, ${r.at_rest ? "at rest" : "turning"}`);
    },
  };
}

function tableDial(axis) {
  const holes = [45, 135, 225, 315].map((deg) => { const [cx, cy] = onDial(36, deg); return svg("circle", { cx, cy, r: 5, class: "hole" }); });
  const plate = svg("g", { class: "turning" }, svg("circle", { r: 46, class: "disc" }), ...holes, svg("path", { class: "hand", d: HAND }));
  const rate = text(0, 22, "", "name"), way = svg("path", { class: "way", d: "" });
  const drawing = picture(`rate table, axis ${axis}`, "-80 -80 160 160", ...ring(58, COMPASS), plate, way, rate);
  let latest = {};
  const turnPlate = () => {
    if (latest.angle_deg === null || latest.angle_deg === undefined) return;
    const since_s = latest.mode === "rate" ? Math.min(Math.max(time_s - latest.t_s, 0), LONGEST_S) : 0;
    plate.setAttribute("transform", `rotate(${latest.angle_deg + latest.rate_dps * since_s})`);
  };
  return {
    picture: drawing,
    turn: turnPlate,
    show(r) {
      latest = r;
      turnPlate();
      moving(plate, !r.at_rest);
      way.setAttribute("d", r.rate_dps ? arrow(Math.sign(r.rate_dps)) : "");
      rate.textContent = r.rate_dps === null ? "no readout" : `${digits(+r.rate_dps.toFixed(3))} deg/s`;
      const where = r.angle_deg === null ? "without a readout" : `at ${digits(r.angle_deg)} deg, ${digits(r.rate_dps)} deg/s`;
      say(drawing, `rate table, axis ${axis}, ${where}, ${r.at_rest ? "at rest" : r.mode}`);
    },
  };
}

// An arc over the top with its head at the end to which the axis turns.
function arrow(sign) {
  const [x, y] = onDial(50, sign * 40), [a, b] = [onDial(45, sign * 33), onDial(55, sign * 33)];
  return `${arcPath(50, -sign * 40, sign * 40)}M${a[0]} ${a[1]}L${x} ${y}L${b[0]} ${b[1]}`;
}

function thermometer() {
  let [low, high] = CHAMBER_DEGC;
  const y = (degc) => 118 - (108 * (degc - low)) / (high - low);
  const scale = svg("g"), column = svg("line", { x1: 64, x2: 64, y1: 132, class: "column" }), ramp = svg("path", { class: "way", d: "" });
  const point = svg("path", { class: "mark", d: "M72 0L84 -6V6Z" }), setting = text(88, 0, "", "name", "start");
  const glass = svg("path", { class: "plate", d: "M58 128V10A6 6 0 0 1 70 10V128A11 11 0 1 1 58 128Z" });
  const drawing = picture("thermal chamber", "0 0 160 156", glass, svg("circle", { cx: 64, cy: 137, r: 8, class: "bulb" }), column, scale, ramp, point, setting);
  const draw = () => scale.replaceChildren(...roundMarks(low, high, 7).flatMap((degc) => [
    svg("line", { x1: 48, x2: 55, y1: y(degc), y2: y(degc), class: "scale" }), text(44, y(degc) + 4, degc, "name", "end")]));
  draw();
  return {
    picture: drawing,
    show(r) {
      const [least, most] = [Math.min(r.temp_degc, r.set_degc), Math.max(r.temp_degc, r.set_degc)];
      if (least < low || most > high) {
        [low, high] = [Math.min(low, 20 * Math.floor(least / 20)), Math.max(high, 20 * Math.ceil(most / 20))];
        draw();
      }
      column.setAttribute("y2", y(r.temp_degc));
      point.setAttribute("transform", `translate(0 ${y(r.set_degc)})`);
      setting.setAttribute("y", y(r.set_degc) + 4);
      setting.textContent = `${digits(r.set_degc)} degC`;
      const way = Math.sign(r.set_degc - r.temp_degc) * Math.min(Math.abs(r.set_degc - r.temp_degc), AHEAD_MIN * r.ramp_k_per_min);
      ramp.setAttribute("d", r.stable ? "" : upOrDown(78, y(r.temp_degc), y(r.temp_degc + way)));
      const state = r.stable ? "stable" : `on its way, ${digits(r.ramp_k_per_min)} K/min`;
      say(drawing, `thermal chamber at ${digits(r.temp_degc)} degC, set point ${digits(r.set_degc)} degC, ${state}`);
    },
  };
}

// Where the ramp is in AHEAD_MIN minutes.
const upOrDown = (x, from, to) => `M${x} ${from}V${to}M${x - 4} ${to + 5 * Math.sign(from - to)}L${x} ${to}L${x + 4} ${to + 5 * Math.sign(from - to)}`;

function voltmeter() {
  let most = 0;
  const angle = (v) => -70 + (140 * Math.min(Math.max(v, 0), most)) / most;
  const hand = svg("path", { class: "hand", d: "M-3 0L0 -60L3 0Z" }), set = svg("path", { class: "mark", d: "M0 -66L-5 -57H5Z" });
  const dip = svg("path", { class: "dip", d: "" }), word = text(0, 18, "", "name"), scale = svg("g");
  const drawing = picture("supply", "-90 -90 180 114", svg("path", { class: "scale", d: arcPath(66, -70, 70) }), scale, dip, set, hand, svg("circle", { r: 4, class: "pin" }), word);
  const draw = () => scale.replaceChildren(...roundMarks(0, most, 5).flatMap((v) => {
    const [x, y] = onDial(78, angle(v));
    return [spoke(62, 70, angle(v), "scale"), text(x, y + 4, v, "name")];
  }));
  return {
    picture: drawing,
    show(r, faults) {
      const drop_v = recentDip(faults), down_v = Math.max(r.volt_v - drop_v, 0), high_v = Math.max(r.volt_v, r.measured_v);
      if (high_v > most) { most = METERS_V.find((m) => m >= high_v) ?? high_v; draw(); }
      hand.setAttribute("transform", `rotate(${angle(r.measured_v)})`);
      set.setAttribute("transform", `rotate(${angle(r.volt_v)})`);
      dip.setAttribute("d", drop_v ? arcPath(60, angle(r.volt_v), angle(down_v)) : "");
      word.textContent = !r.on ? "output off" : drop_v ? `dip to ${digits(down_v)} V` : `${digits(r.measured_v)} V`;
      const words = [`supply at ${digits(r.measured_v)} V, set to ${digits(r.volt_v)} V`, r.on ? "" : "output off", drop_v ? `dip to ${digits(down_v)} V` : ""];
      say(drawing, words.filter(Boolean).join(", "));
    },
  };
}

// A dip may be shorter than the time between two readings: the list of faults has it. At a great speed it is over at
// once, so it stays for a while of the page's own time, too.
function recentDip(faults) {
  const dips = faults.filter((f) => f.drop_v && f.began_s !== undefined && f.began_s !== null);
  for (const f of dips) if (!dipSeen.has(f.id)) dipSeen.set(f.id, performance.now());
  const recent = dips.filter((f) => time_s - (f.ended_s ?? time_s) < RECENT_S || performance.now() - dipSeen.get(f.id) < 1000 * SHOWN_S);
  return Math.max(0, ...recent.map((f) => f.drop_v));
}
