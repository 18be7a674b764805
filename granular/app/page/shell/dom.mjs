// The little that is needed to make and change elements.

const SVG = "http://www.w3.org/2000/svg";

export const $ = (selector, root = document) => root.querySelector(selector);

export function h(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

function fill(element, attributes, children) {
  set(element, attributes);
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

export function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if ((value ?? false) === false) element.removeAttribute(name);
    else element.setAttribute(name, value === true ? "" : value);
  }
}

// Which of its classes an element has, by name.
export function classes(element, states) {
  for (const name in states) element.classList.toggle(name, Boolean(states[name]));
}

export function text(element, content) {
  if (element.textContent !== content) element.textContent = content;
}

// An SVG element in writing, numbers to a tenth of a pixel: to hand the browser a whole drawing at once is several times
// faster than element by element.
export function markup(tag, attributes, content = "") {
  let written = `<${tag}`;
  for (const name in attributes) written += ` ${name}="${escaped(tenths(attributes[name]))}"`;
  return `${written}>${escaped(content)}</${tag}>`;
}

// Far quicker than toFixed, and there are thousands.
export const tenths = (x) => (typeof x === "number" ? Math.round(10 * x) / 10 : x);

const escaped = (value) => String(value).replace(/[&<"]/g, (sign) => ({ "&": "&amp;", "<": "&lt;", '"': "&quot;" })[sign]);

// "ε_eff" with its subscript set low.
export const marked = (content) =>
  content.split(/(_\w+)/).filter(Boolean).map((part) => (part.startsWith("_") ? h("sub", {}, part.slice(1)) : part));

// Rows of cells, each row [class, name, ...values]; cells that stay are kept, so a move changes little.
export function fillTable(table, head, rows) {
  const shape = `${rows.length}×${head.length}`;
  if (table.shape !== shape) {
    table.shape = shape;
    const body = rows.map(() => h("tr", {}, h("th", { scope: "row" }), ...head.slice(1).map(() => h("td"))));
    table.replaceChildren(h("thead", {}, h("tr", {}, ...head.map((name) => (name ? h("th", { scope: "col" }) : h("td"))))), h("tbody", {}, ...body));
  }
  const [top, ...others] = table.rows;
  head.forEach((name, j) => text(top.cells[j], name));
  rows.forEach(([kind, ...values], i) => {
    others[i].className = kind;
    values.forEach((value, j) => text(others[i].cells[j], value));
  });
}

export const whenIdle = window.requestIdleCallback ?? ((work) => setTimeout(work, 30));

export function save(name, type, content) {
  const url = URL.createObjectURL(new Blob([content], { type }));
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

export const csv = (rows) => rows.map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";
const cell = (value) => (typeof value === "string" && /[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : String(value));
