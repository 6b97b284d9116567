// Forks of the panel's bench: one is shown, the others rest.

import { $, complain, options } from "./page.js";

export function offer(m, link) {
  const ask = (request) => link.ask(request).then(() => complain(""), (e) => complain(e.message));
  $("#forks").hidden = !m.forks;
  $("#shown").textContent = m.resting.length ? `${m.shown} of ${m.resting.length + 1}` : "";
  $("#others").hidden = !m.resting.length;
  options($("#resting"), m.resting);
  $("#fork-from").hidden = !m.forks;
  const seed = () => ($("#fork-seed").value === "" ? {} : { seed: Number($("#fork-seed").value) });
  $("#fork").onclick = () => ask({ do: "fork", ...seed() });
  $("#fork-from").onclick = () => ask({ do: "fork", file: $("#snapshots").value, ...seed() });
  $("#show-bench").onclick = () => ask({ do: "show", name: $("#resting").value });
  $("#drop-bench").onclick = () => ask({ do: "drop", name: $("#resting").value });
}
