// Small helpers for the document. Text goes in as text, never as HTML.

export const $ = (selector) => document.querySelector(selector);

export function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") element.className = value;
    else if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value !== undefined && value !== null) element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

export function fill(body, rows) {
  // Cells as texts, as [text, class], or as elements; only what has changed is written.
  while (body.rows.length > rows.length) body.deleteRow(-1);
  rows.forEach((row, i) => {
    const tr = body.rows[i] || body.insertRow();
    while (tr.cells.length < row.length) tr.insertCell();
    row.forEach((cell, k) => {
      const td = tr.cells[k];
      if (cell instanceof Node) { if (td.firstChild !== cell) td.replaceChildren(cell); return; }
      const [text, kind] = Array.isArray(cell) ? cell : [cell, ""];
      if (td.textContent !== String(text) || td.firstElementChild) td.textContent = text;
      if (td.className !== kind) td.className = kind;
    });
  });
}

export function options(select, values, chosen) {
  const key = JSON.stringify(values);
  if (select.dataset.key === key) return;
  select.dataset.key = key;
  select.replaceChildren(...values.map((v) => make("option", { value: v, selected: v === chosen }, v)));
}

export const digits = (x) => (x === null || x === undefined ? "-" : typeof x === "number" ? String(Math.abs(x) < 1e6 ? +x.toPrecision(7) : Math.round(x)) : String(x)); // of codes every digit

let hide;
export function complain(text) {
  const box = $("#message");
  box.textContent = text;
  box.hidden = !text;
  clearTimeout(hide);
  if (text) hide = setTimeout(() => { box.hidden = true; }, 15000);
}
