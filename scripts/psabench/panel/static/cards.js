// Registers, faults, lines, CAN, overview.

import { $, complain, digits, fill, make, options } from "./page.js";
import { input, labelled, lineOf } from "./forms.js";
import { svg } from "./svg.js";

export function registers(hello, say) {
  const banks = Object.keys(hello.registers);
  options($("#bank"), banks, banks[0]);
  const names = () => Object.keys(hello.registers[$("#bank").value] || {});
  const form = $("#write-register");
  const fields = () => {
    const rows = (hello.registers[$("#bank").value] || {})[form.elements.register.value] || [];
    $("#fields").replaceChildren(...rows.map((f) => fieldInput(f)));
  };
  const read = async () => {
    const answer = await say(`dut.registers ${$("#bank").value}`, true);
    if (answer) fill($("#registers tbody"), answer.result.registers.map((r) => [[r.address, "code"], r.register, [r.value, "code"], [r.fields, "text"]]));
  };
  const choose = () => { options(form.elements.register, names()); fields(); };
  $("#bank").onchange = () => { choose(); read(); };
  form.elements.register.onchange = fields;
  $("#read-registers").onclick = read;
  form.onsubmit = async (event) => {
    event.preventDefault();
    const set = [...$("#fields").querySelectorAll("[data-field]")].filter((e) => e.value !== "");
    const value = form.elements.value.value.trim() || set.map((e) => `${e.dataset.field}=${e.value}`).join(",");
    if (!value) { complain("value: expected a byte or a field, got none"); return; }
    if (await say(`dut.write ${$("#bank").value} ${form.elements.register.value} ${value}`)) { form.elements.value.value = ""; fields(); read(); }
  };
  choose();
  $("#registers").hidden = !banks.length;
}

function fieldInput(field) {
  const known = Object.entries(field.meaning);
  const box = make(known.length ? "select" : "input", { "data-field": field.name, "aria-label": `field ${field.name}` });
  if (known.length) box.append(make("option", { value: "" }, "-"), ...known.map(([v, text]) => make("option", { value: v }, `${v} ${text}`)));
  else Object.assign(box, { size: 4, placeholder: `0..${field.high}` });
  return make("label", {}, `${field.name} `, box);
}

export function faultForm(hello, say) {
  const form = $("#add-fault"), command = hello.commands["faults.add"];
  $("#faults").hidden = !command;
  if (!command) return;
  const kinds = Object.entries(command.variants).filter(([, v]) => v.args[1].choices.length).map(([k]) => k);
  const kind = make("select", { name: "kind", "aria-label": "faults.add kind" });
  options(kind, kinds);
  const rest = make("div");
  const choose = () => {
    const variant = command.variants[kind.value];
    rest.replaceChildren(make("p", { class: "quiet" }, variant.what), make("div", { class: "form" },
      ...variant.args.slice(1).map((a) => make("label", {}, labelled(a), input({ ...a, strict: a.strict || a.name === "point" }, "faults.add"))), make("button", {}, "Inject")));
  };
  kind.onchange = choose;
  form.replaceChildren(make("label", {}, "kind ", kind), rest);
  form.onsubmit = (event) => { event.preventDefault(); say(lineOf("faults.add", command.variants[kind.value].args, form)); };
  if (kinds.length) choose();
}

const clearButtons = new Map();

export function faultList(state, now, say) {
  const rows = state.faults.map((f) => {
    if (!clearButtons.has(f.id)) clearButtons.set(f.id, make("button", { onclick: () => say(`faults.clear ${f.id}`) }, "End"));
    return [f.id, f.kind, f.point, [f.state, f.state === "active" ? "bad" : ""], digits(f.began_s), digits(f.ended_s), clearButtons.get(f.id)];
  });
  for (const id of clearButtons.keys()) if (!state.faults.some((f) => f.id === id)) clearButtons.delete(id);
  fill($("#faults tbody"), rows);
  timeline(state.faults.filter((f) => f.began_s !== undefined && f.began_s !== null), now);
}

function timeline(faults, now) {
  const strip = $("#timeline"), height = faults.length * 14;
  strip.setAttribute("height", height);
  if (!height) { strip.replaceChildren(); return; }
  const begin = Math.min(...faults.map((f) => f.began_s)), span = Math.max(now - begin, 1e-6);
  const width = strip.clientWidth || 300;
  strip.replaceChildren(...faults.flatMap((f, i) => {
    const from = ((f.began_s - begin) / span) * width, to = (((f.ended_s ?? now) - begin) / span) * width;
    const bar = svg("rect", { x: from, y: i * 14 + 2, width: Math.max(2, to - from), height: 9, fill: f.ended_s === undefined ? "var(--bad)" : "var(--quiet)" });
    bar.append(svg("title", {}, `${f.kind} ${f.point}`));
    return [bar];
  }));
}

export function board(state) {
  const lines = Object.entries(state.lines);
  const holder = $("#lines");
  if (holder.childElementCount !== lines.length) holder.replaceChildren(...lines.map(([n]) => make("span", { "data-line": n })));
  lines.forEach(([name, level], i) => {
    holder.children[i].textContent = `${name} ${level}`;
    holder.children[i].className = level ? "on" : "";
  });
  const parts = Object.entries(state.counters).map(([part, c]) => [part, Object.entries(c).filter(([, v]) => v)]);
  $("#counters").textContent = parts.filter(([, c]) => c.length).map(([p, c]) => `${p}: ${c.map(([k, v]) => `${k} ${v}`).join(", ")}`).join("\n");
}

export function overview(state, chosen, say) {
  $("#overview").hidden = state.overview.length < 2;
  if (state.overview.length > 1) fill($("#overview tbody"), state.overview.map((u) => [u.name, u.board, u.samples, [u.lost, u.lost ? "bad" : ""],
    [u.torn, u.torn ? "bad" : ""], [u.last.map(([n, v, unit]) => `${n} ${digits(v)} ${unit}`).join(", "), "text"]]));
  const unit = state.overview.find((u) => u.name === chosen);
  $("#health").textContent = unit ? `${unit.board}: ${unit.samples} samples, lost ${unit.lost}, torn ${unit.torn}${lines(unit)}${begun(unit)}` : "";
  const names = state.overview.map((u) => u.name);
  const holder = $("#units");
  if (holder.dataset.key !== names.join()) {
    holder.dataset.key = names.join();
    holder.replaceChildren(...names.map((n) => make("button", { "data-unit": n, onclick: () => say(`dut.use ${n}`) }, n)));
  }
  for (const button of holder.children) button.setAttribute("aria-pressed", button.dataset.unit === chosen);
}

const begun = ({ stretches }) => (stretches > 1 ? `; in ${stretches} stretches of the stream` : "");
const lines = ({ lines: [frames, torn] }) => (frames ? `; on the lines ${frames} frames drawn, torn ${torn}` : "");

export function can(message) {
  const trace = $("#trace").checked;
  const rows = message.buses.flatMap((b) => (trace ? b.latest : b.ids).map((r) => [r.t_s.toFixed(6), [r.id, "code"], r.name,
    r.count ?? "", r.per_s === undefined || r.per_s === null ? "" : r.per_s.toFixed(1), [r.data, "code"], [r.text, "text"]]));
  fill($("#can tbody"), rows);
}

export function busLoad(state) {
  const load = state.bus.load;
  $("#bus-load").textContent = state.bus.frames === undefined ? "" :
    `${state.bus.bitrate_hz / 1000} kbit/s, load ${(100 * load).toFixed(1)} %, ${state.bus.frames} frames`;
}
