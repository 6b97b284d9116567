// A procedure that was started here: its progress, what it says, its report.

import * as intervals from "./intervals.js";
import { $, complain, options } from "./page.js";

let fits = [], offered = {};

export function offer(hello, link) {
  fits = hello.fits || [];
  offered = hello.offered;
  $("#procedure-where").hidden = !fits.length;
  if (!fits.length) $("#procedure-here").checked = false;
  $("#procedure-here").onchange = choose;
  $("#procedure").onchange = choose;
  choose();
  $("#run").onclick = () => link.ask({ do: "run", name: $("#procedure").value, here: $("#procedure-here").checked }).then(() => complain(""), (e) => complain(e.message));
  $("#stop").onclick = () => link.ask({ do: "stop" }).catch((e) => complain(e.message));
  follow(hello.procedure);
}

function choose() {
  const here = $("#procedure-here").checked;
  options($("#procedure"), here ? fits : Object.keys(offered), $("#procedure").value);
  $("#procedure-what").textContent = offered[$("#procedure").value] || "";
}

// What moves or changes the bench is out of reach while a procedure has it: the panel rejects it, too.
const HELD = "#controls, #until-event, #snapshot, #back, #forks, #start-stream, #stop-stream, #reset-unit, #registers, #faults, #instruments form, #frame, #scenario, #line, #gyro-ask";
let lent = "";
export function hold(name) {
  $("#lent").hidden = !name;
  $("#lent").textContent = name ? `The procedure ${name} has this bench: it moves the time, the instruments and the unit. Stop on the card Procedures ends it and gives the bench back.` : "";
  if (name === lent) return;
  lent = name;
  for (const element of document.querySelectorAll(HELD)) element.inert = Boolean(name);
  document.body.classList.toggle("lent", Boolean(name));
}

export function follow(m) {
  intervals.follow(m.intervals);
  $("#progress").max = Math.max(1, m.total);
  $("#progress").value = m.done;
  $("#procedure-step").textContent = m.name ? `${m.name}: ${m.state}${m.step ? `, ${m.step} ${m.done}/${m.total}` : ""}${m.note ? `; ${m.note}` : ""}` : "";
  $("#run").disabled = m.state === "running";
  $("#stop").disabled = m.state !== "running";
  $("#report").hidden = !m.report;
  if (m.report) $("#report").href = m.report;
  $("#procedure-lines").hidden = !m.lines.length;
  $("#procedure-lines").textContent = m.lines.join("\n");
}
