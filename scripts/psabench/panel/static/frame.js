// Frames on the lines: drawn, counted, torn on purpose.

import { $, complain, make } from "./page.js";

export function offer(hello, link, say) {
  const holder = $("#tears");
  holder.hidden = !hello.tears.length;
  holder.replaceChildren("Tear frames, until End:", ...hello.tears.map((t) => make("span", {},
    make("button", { "data-tear": t.where, title: t.line, onclick: () => say(t.line) }, t.where), make("span", { class: "quiet" }, ` ${t.seen}`))));
  $("#frame").onclick = () => link.ask({ do: "frame" }).then(show, (error) => complain(error.message));
}

function show(answer) {
  const drawn = answer.torn ? `drawn: a torn one, ${answer.bits} bits` : "drawn: a whole one";
  $("#frame-said").textContent = `${answer.frames} frames recorded, torn ${answer.torn}; ${drawn}`;
  put($("#frame-picture"), answer.svg, `frame on Int, Data and CLK; ${drawn}`);
}

export function put(picture, svg, words) {
  URL.revokeObjectURL(picture.src);
  picture.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  picture.alt = words;
  picture.hidden = false;
}
