// Ends the line that is being carried out, whoever has said it. Not by name of the line: a button has to be quick.

import { $, complain } from "./page.js";

export function offer(link) {
  const stop = () => link.ask({ do: "interrupt" }).catch((e) => complain(e.message));
  $("#interrupt").onclick = stop;
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && !$("#interrupt").hidden) { event.preventDefault(); stop(); }
  });
}

export function show(busy) {
  $("#interrupt").hidden = !busy;
  $("#interrupt").title = busy ? `${busy} is being carried out; Esc stops it` : "";
}
