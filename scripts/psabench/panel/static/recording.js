// A recording in place of a bench: which file, and times to go to, backwards as well.

import { $, complain, options } from "./page.js";

export function offer(about, link, say, now) {
  $("#recording").hidden = !about;
  document.body.classList.toggle("recording", Boolean(about));
  if (!about) return;
  $("#line").elements.line.placeholder = `at ${((about.start_ns || 0) / 1e9 + about.length_s / 2).toFixed(4)}`;
  options($("#recording-file"), about.files, about.file);
  $("#recording-file").value = about.file;
  const length = `${about.whole ? "" : "more than "}${about.length_s.toFixed(3)} s`;
  const what = about.kind === "lines" ? `${about.board}: ${about.lines.length} lines` : `bus ${about.buses.join(", ")}`;
  $("#recording-about").textContent = `${length}, ${what}${about.damage ? `; ${about.damage}` : ""}`;
  $("#recording-file").onchange = (event) => link.ask({ do: "recording", name: event.target.value })
    .then(() => complain(""), (e) => { complain(e.message); event.target.value = about.file; });
  for (const button of document.querySelectorAll("[data-back]"))
    button.onclick = () => say(`at ${Math.max(0, now() - Number(button.dataset.back)).toFixed(9)}`);
  $("#recording-go").onclick = () => { if ($("#recording-at").value !== "") say(`at ${$("#recording-at").value}`); };
}

export function state(m) {
  $("#recording-ended").textContent = m.ended || "";
  $("#recording-ended").className = m.ended === "end" ? "quiet" : "bad";
}
