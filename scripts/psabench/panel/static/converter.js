// A bare converter on a bench of its own, read in time or across the next word.

import { $, complain, digits, options } from "./page.js";
import { put } from "./frame.js";

export function offer(hello, link) {
  const form = $("#read-converter"), { part, sclk_hz, late_us } = form.elements;
  options(part, Object.keys(hello.converters));
  part.onchange = () => {
    const { sclk_hz: hz, hint } = hello.converters[part.value];
    sclk_hz.value = hz;
    late_us.value = 0;
    $("#converter-hint").textContent = hint;
  };
  if (!sclk_hz.value) part.onchange();
  const read = (across) => link.ask({ do: "converter", part: part.value, sclk_hz: Number(sclk_hz.value), late_us: Number(late_us.value), across })
    .then((answer) => show(answer, late_us, part.value), (error) => complain(error.message));
  form.onsubmit = (event) => { event.preventDefault(); read(false); };
  $("#read-across").onclick = () => read(true);
}

function show(answer, late_us, part) {
  late_us.value = digits(answer.late_us);
  const counted = Object.entries(answer.counters).map(([name, n]) => `${name} ${n}`).join(", ");
  $("#converter-said").className = answer.torn ? "bad" : "good";
  $("#converter-said").textContent = `read ${answer.read}, ${answer.torn ? "torn" : "whole"}: in time ${answer.in_time}, next word ${answer.next}; `
    + `a word each ${digits(answer.period_us)} us, a read takes ${digits(answer.took_us)} us; ${counted ? `counted by the chip: ${counted}` : "no violation"}`;
  put($("#converter-picture"), answer.svg, `edges of ${part}: ${answer.torn ? "a torn read" : "a whole read"}`);
}
