// A procedure that was started here: its progress, what it says, its report.

import * as intervals from "./intervals.js";
import { $, complain, options } from "./page.js";

export function offer(hello, link) {
  options($("#procedure"), Object.keys(hello.offered));
  const what = () => { $("#procedure-what").textContent = hello.offered[$("#procedure").value]; };
  $("#procedure").onchange = what;
  what();
  $("#run").onclick = () => link.ask({ do: "run", name: $("#procedure").value }).catch((e) => complain(e.message));
  $("#stop").onclick = () => link.ask({ do: "stop" }).catch((e) => complain(e.message));
  follow(hello.procedure);
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
