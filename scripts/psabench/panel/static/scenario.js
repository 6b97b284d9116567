// A scenario chosen by name and edited as text; psa-emu checks it, and says in which line it is wrong.

import { $, options } from "./page.js";

const MOST_BYTES = 4000; // of the request: the panel closes a page that sends 4096
let whats = {};

export function offer(hello, link) {
  $("#scenario").hidden = !hello.restores;
  $("#scenario details").ontoggle = (event) => { if (event.target.open && !$("#scenario-text").value) load(link); };
  $("#scenario-name").onchange = () => choose(link);
  $("#begin").onclick = () => begin(link);
}

async function load(link) {
  const m = await asked(link, { do: "scenarios" });
  if (!m) return;
  whats = Object.fromEntries(m.names.map((n) => [n.name, n.what]));
  options($("#scenario-name"), [...new Set([...m.names.map((n) => n.name), m.name])], m.name);
  show(m.text);
}

async function choose(link) {
  const m = await asked(link, { do: "scenario", name: $("#scenario-name").value });
  if (m) show(m.text);
}

function show(text) {
  $("#scenario-text").value = text;
  $("#scenario-what").textContent = whats[$("#scenario-name").value] || "";
}

async function begin(link) {
  const seed = $("#scenario-seed").value, request = { do: "begin", name: $("#scenario-name").value, text: $("#scenario-text").value };
  if (seed !== "") request.seed = Number(seed);
  const bytes = new TextEncoder().encode(JSON.stringify(request)).length;
  if (bytes > MOST_BYTES) { fail(`scenario: expected up to ${MOST_BYTES} bytes, got ${bytes}; start psabench panel FILE with a longer one`); return; }
  $("#begin").disabled = true;
  await asked(link, request);
  $("#begin").disabled = false;
}

async function asked(link, request) {
  try {
    const answer = await link.ask(request);
    fail("");
    return answer;
  } catch (error) { fail(error.message); return null; }
}

function fail(text) {
  $("#scenario-error").textContent = text;
  const place = /^line (\d+)/.exec(text), box = $("#scenario-text");
  if (!place) return;
  const lines = box.value.split("\n"), from = lines.slice(0, place[1] - 1).reduce((n, l) => n + l.length + 1, 0);
  box.focus();
  box.setSelectionRange(from, from + (lines[place[1] - 1] || "").length);
}
