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
    else if (value === false || value === null) element.removeAttribute(name);
    else element.setAttribute(name, value === true ? "" : value);
  }
}

export function text(element, content) {
  if (element.textContent !== content) element.textContent = content;
}

// "ε_eff" with its subscript set low, in HTML or in a chart.
export function marked(content, inChart = false) {
  return content.split(/(_\w+)/).filter(Boolean).flatMap((part) => {
    if (!part.startsWith("_")) return [part];
    if (!inChart) return [h("sub", {}, part.slice(1))];
    return [svg("tspan", { dy: 3, "font-size": 9 }, part.slice(1)), svg("tspan", { dy: -3 }, "\u200B")];
  });
}

export function save(name, type, content) {
  const url = URL.createObjectURL(new Blob([content], { type }));
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

export const csv = (rows) => rows.map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";
const cell = (value) => (typeof value === "string" && /[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : String(value));
