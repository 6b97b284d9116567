// Recorded lines: a window that is moved and zoomed, frames and errors to go to. What it shows comes from the panel.

import { draw, LEFT } from "./lines_draw.js";
import { $, complain, make } from "./page.js";

const LEAST_NS = 20, TURN_MS = 80, FIRST_FRAMES = 3;  // the panel closes a page that asks more often than 20 times a second
let about = null, link = null, key = "", from = 0, to = 0, at = null, shown = null, waiting = false, again = false, now = 0;

const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const columns = () => clamp(Math.round($("#lines-picture").clientWidth - LEFT), 50, 4000);
const chosen = () => [...document.querySelectorAll("#lines-names input:checked")].map((box) => box.value).slice(0, 64);

export function offer(recording, toPanel) {
  link = toPanel;
  const lines = recording && recording.kind === "lines" ? recording : null;
  $("#recorded-lines").hidden = !lines;
  document.body.classList.toggle("of-lines", Boolean(lines));
  about = lines;
  if (!lines || key === `${lines.file} ${lines.start_ns} ${lines.end_ns}`) return;
  key = `${lines.file} ${lines.start_ns} ${lines.end_ns}`;
  $("#lines-names").replaceChildren(...lines.lines.map((name, k) => make("label", {},
    make("input", { type: "checkbox", value: name, checked: k < (lines.shown || 16), onchange: ask }), ` ${name}`)));
  const torn = lines.torn ? `, torn ${lines.torn}` : "";
  $("#lines-said").textContent = lines.frames ? `${lines.frames} ${lines.what}s, errors ${lines.errors}${torn}` : "no decoder knows these lines";
  for (const id of ["#frame-back", "#frame-on", "#torn-on", "#error-on"]) $(id).hidden = !lines.frames;
  at = null;
  set(lines.start_ns, lines.end_ns);
  if (lines.frames) next("frame", false, lines.start_ns);
}

export function time(t_s, playing) {
  now = Math.round(t_s * 1e9);
  if (!about) return;
  if (playing && $("#lines-follow").checked && (now < from || now > to)) set(now - (to - from) / 10, now + (to - from) * 0.9);
  else if (shown) picture();
}

function set(a, b) {
  const span = clamp(b - a, LEAST_NS, about.end_ns - about.start_ns);
  from = Math.round(clamp(a, about.start_ns, about.end_ns - span));
  to = Math.round(from + span);
  ask();
}

const zoom = (factor, x = 0.5) => { const span = (to - from) * factor, middle = from + (to - from) * x; set(middle - span * x, middle + span * (1 - x)); };
const move = (part) => set(from + part * (to - from), to + part * (to - from));

// One request at a time: the next one when the answer is there, with the window as it is by then.
async function ask() {
  if (!about || document.hidden) return;
  if (waiting) { again = true; return; }
  waiting = true;
  try {
    shown = await link.ask({ do: "window", from_ns: from, to_ns: to, columns: columns(), lines: chosen() });
    picture();
    await new Promise((done) => setTimeout(done, TURN_MS));
  } catch (error) { complain(error.message); }
  waiting = false;
  if (again) { again = false; ask(); }
}

function picture() {
  if (!about || shown.from_ns === undefined) return;
  draw($("#lines-picture"), shown, at, now, about.what);
}

async function next(what, back, at_ns) {
  const instant = at_ns ?? (at && at.begin_ns >= from && at.begin_ns <= to ? at.begin_ns : Math.round((from + to) / 2));
  try {
    at = await link.ask({ do: "next", what, back, at_ns: instant });
    complain("");
  } catch (error) { complain(error.message); return; }
  $("#lines-at").textContent = `${about.what} ${at.place} of ${about.frames} at ${(at.begin_ns / 1e9).toFixed(9)} s${at.wrong ? `: ${at.wrong}` : ""}`;
  const length = at.end_ns - at.begin_ns, span = to - from;
  if (span > 40 * length || span < length) set(at.begin_ns - length * 0.1, at.end_ns + length * (at_ns === undefined ? 0.1 : 0.1 * FIRST_FRAMES));
  else set(at.begin_ns - (span - length) / 2, at.end_ns + (span - length) / 2);
}

const BUTTONS = {
  "#frame-back": () => next("frame", true), "#frame-on": () => next("frame", false), "#torn-on": () => next("torn", false),
  "#error-on": () => next("error", false), "#lines-in": () => zoom(0.5), "#lines-out": () => zoom(2), "#lines-left": () => move(-0.5),
  "#lines-right": () => move(0.5), "#lines-all": () => set(about.start_ns, about.end_ns), "#lines-now": () => set(now - (to - from) / 2, now + (to - from) / 2),
};
for (const [id, action] of Object.entries(BUTTONS)) $(id).onclick = action;

const KEYS = { ArrowLeft: () => move(-0.25), ArrowRight: () => move(0.25), "+": () => zoom(0.5), "-": () => zoom(2), n: () => next("frame", false), p: () => next("frame", true), e: () => next("error", false) };
$("#lines-picture").addEventListener("keydown", (event) => {
  if (KEYS[event.key] && !event.ctrlKey && !event.altKey) { event.preventDefault(); KEYS[event.key](); }
});
const part = (event) => clamp((event.clientX - $("#lines-picture").getBoundingClientRect().left - LEFT) / columns(), 0, 1);
$("#lines-picture").addEventListener("wheel", (event) => { event.preventDefault(); zoom(event.deltaY > 0 ? 1.25 : 0.8, part(event)); }, { passive: false });
let drag = null;
$("#lines-picture").addEventListener("pointerdown", (event) => { drag = { x: part(event), from, to }; $("#lines-picture").setPointerCapture(event.pointerId); });
$("#lines-picture").addEventListener("pointermove", (event) => {
  if (!drag) return;
  const by = (drag.x - part(event)) * (drag.to - drag.from);
  set(drag.from + by, drag.to + by);
});
for (const kind of ["pointerup", "pointercancel"]) $("#lines-picture").addEventListener(kind, () => { drag = null; });
new ResizeObserver(() => ask()).observe($("#lines-picture"));

export const state = () => ({ from, to, at, seen: shown ? shown.seen : 0 });
