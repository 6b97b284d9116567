// Puts the cards together: what comes from the panel goes to them, what is clicked goes back as lines of the shell.

import { Link } from "./link.js";
import { $, complain, make, options } from "./page.js";
import * as plots from "./plots.js";
import * as cards from "./cards.js";
import * as converter from "./converter.js";
import * as forks from "./forks.js";
import * as frame from "./frame.js";
import * as gyro from "./gyro.js";
import { instruments, readings, turn } from "./instruments.js";
import * as lines from "./lines.js";
import * as interrupt from "./interrupt.js";
import * as intervals from "./intervals.js";
import * as procedures from "./procedures.js";
import * as recording from "./recording.js";
import * as scenario from "./scenario.js";
import * as statistics from "./statistics.js";

let hello = null, now = 0, playing = false;
const counts = { update: 0, state: 0, can: 0, hello: 0, drawn: 0 };

const link = new Link(take, (text) => {
  $("#link").textContent = text;
  $("#link").className = text === "connected" ? "good" : "bad";
});

async function say(line, quiet = false) {
  try {
    const answer = await link.say(line);
    time(answer.time);
    complain("");
    if (!quiet || answer.failed) log(line, answer.text);
    return answer;
  } catch (error) {
    complain(error.message);
    log(line, error.message);
    return null;
  }
}

function log(line, text) {
  const box = $("#log");
  box.textContent = `${box.textContent}> ${line}\n${text ? `${text}\n` : ""}`.slice(-20000);
  box.scrollTop = box.scrollHeight;
}

const HANDLERS = {
  hello: (m) => {
    hello = m;
    time(m.time);
    $("#link").textContent = "connected";
    $("#link").className = "good";
    $("#pace").textContent = m.pace;
    for (const id of ["#controls", "#snapshot"]) $(id).hidden = m.pace === "real" || (id === "#controls" && m.pace !== "step");
    const until = m.commands.until;
    $("#until").hidden = $("#event").hidden = !until;
    if (until) options($("#event"), until.args[0].choices, "INT_FALL");
    options($("#names"), Object.keys(m.commands));
    cards.registers(m, say);
    instruments(m, say);
    gyro.offer(m, say);
    frame.offer(m, link, say);
    converter.offer(m, link);
    cards.faultForm(m, say);
    $("#truth").hidden = !m.truth;
    procedures.offer(m, link);
    scenario.offer(m, link);
    forks.offer(m.benches, link);
    recording.offer(m.recording, link, say, () => now);
    lines.offer(m.recording, link);
    if (m.began) log(`(bench: ${m.began})`, "");
    HANDLERS.snapshots({ names: m.snapshots });
    plots.add(m.history, true);
    options($("#channel"), plots.shown().names);
  },
  update: (m) => { time(m.time); if (m.new) { plots.add(m.new, false); gyro.feed(m.new); options($("#channel"), m.new.names); } },
  state: (m) => {
    recording.state(m);
    readings(m);
    cards.faultList(m, now, say);
    cards.board(m);
    cards.overview(m, hello ? hello.unit : "", say);
    cards.busLoad(m);
  },
  snapshots: (m) => {
    $("#back").hidden = !m.names.length || !(hello && hello.restores);
    options($("#snapshots"), m.names);
  },
  can: cards.can,
  benches: (m) => forks.offer(m, link),
  procedure: procedures.follow,
  truth: (m) => {
    if (!$("#truth-switch").checked) return;
    $("#truth-state").textContent = m.error || JSON.stringify(m.state, null, 1);
    gyro.truth(m.state);
  },
  opening: (m) => {
    $("#link").textContent = m.done === null ? "connected" : `opening ${m.name}: ${Math.round(100 * m.done)} %`;
    $("#link").className = m.done === null ? "good" : "";
  },
  lost: (m) => { $("#link").textContent = `no bench: ${m.why}; waiting for it`; $("#link").className = "bad"; },
};

function take(message) {
  counts[message.kind] = (counts[message.kind] || 0) + 1;
  const handler = HANDLERS[message.kind];
  if (handler) handler(message);
}

function time(t) {
  now = t.t_s;
  turn(now);
  lines.time(now, t.playing);
  procedures.hold(t.lent);
  playing = t.playing;
  interrupt.show(t.busy);
  $("#time").textContent = `${t.t_s.toFixed(3)} s`;
  $("#play").textContent = playing ? "Pause" : "Run";
  $("#play").setAttribute("aria-pressed", playing);
}

interrupt.offer(link);

const play = (on) => link.ask({ do: "play", on, speed: Number($("#speed").value) }).then((a) => time(a.time), (e) => complain(e.message));
const step = async (length) => { if (playing) await play(false); say(`wait ${length}`); };

$("#play").onclick = () => play(!playing);
$("#speed").onchange = () => play(playing);
for (const button of document.querySelectorAll(".step")) button.onclick = () => step(button.dataset.for);
$("#until").onclick = async () => { if (hello.pace === "step" && playing) await play(false); say(`until ${$("#event").value}`); };
$("#snapshot").onclick = () => say(`bench.snapshot panel-${now.toFixed(3)}s.psasnap`);
$("#restore").onclick = () => link.ask({ do: "restore", file: $("#snapshots").value }).then(() => complain(""), (e) => complain(e.message));
$("#start-stream").onclick = () => say("dut.start");
$("#stop-stream").onclick = () => say("dut.stop");
$("#reset-unit").onclick = () => say("dut.reset");
$("#all-channels").onchange = plots.build;
$("#compute").onclick = () => link.ask({ do: "statistics", channel: $("#channel").value }).then(statistics.show, (e) => complain(e.message));
$("#window").onchange = plots.touch;
$("#line").onsubmit = (event) => {
  event.preventDefault();
  const input = event.target.elements.line;
  if (input.value.trim()) say(input.value.trim());
  input.value = "";
};
$("#line").elements.line.oninput = (event) => {
  const command = hello && hello.commands[event.target.value.trim().split(/\s/)[0]];
  $("#usage").textContent = command ? `${command.what} ${command.args.map((a) => (a.optional ? `[${a.name}]` : a.name)).join(" ")}` : "";
};
$("#truth-switch").onchange = (event) => {
  $("#truth-state").hidden = !event.target.checked;
  if (!event.target.checked) gyro.truth(null);
  link.sendWatch({ truth: event.target.checked });
};

$("#show-lines").ontoggle = (event) => link.sendWatch({ lines: event.target.open });

const THEMES = ["", "light", "dark"];
function theme(name) {
  if (name) document.documentElement.dataset.theme = name; else delete document.documentElement.dataset.theme;
  $("#theme").textContent = `Theme: ${name || "system"}`;
  localStorage.setItem("theme", name);
  repaint();
}
function repaint() {
  plots.build();
  for (const part of [statistics, intervals, gyro]) part.repaint();
}
matchMedia("(prefers-color-scheme: dark)").onchange = repaint;
$("#theme").onclick = () => theme(THEMES[(THEMES.indexOf(localStorage.getItem("theme") || "") + 1) % THEMES.length]);

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || /INPUT|SELECT|TEXTAREA|BUTTON|SUMMARY/.test(event.target.tagName)) return;
  const keys = { " ": () => hello && hello.pace === "step" && play(!playing), ".": () => step("1ms"), "/": () => $("#line").elements.line.focus() };
  if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
});
document.addEventListener("visibilitychange", () => link.sendWatch({ live: !document.hidden }));
new ResizeObserver(plots.resize).observe($("#plots"));

theme(localStorage.getItem("theme") || "");
(function redraw() { plots.draw(); counts.drawn++; requestAnimationFrame(redraw); })();

window.panel = { counts, shown: plots.shown, lines: lines.state, link }; // for tests
