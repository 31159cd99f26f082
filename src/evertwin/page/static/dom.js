// Elements from values. What comes from a machine or a person is text, never markup.

const SVG = "http://www.w3.org/2000/svg";

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && (name === "value" || name === "checked" || name === "disabled")) element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  for (const child of children.flat(Infinity)) {
    if (child === undefined || child === null || child === false) continue;
    element.append(child instanceof Node ? child : document.createTextNode(String(child)));
  }
  return element;
}

/** An element: h("p", {class: "quiet"}, "text", other). */
export function h(tag, attributes, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

/** An element of a drawing. */
export function s(tag, attributes, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

/** Puts these in place of what an element holds, without losing the keyboard's place. */
export function put(element, ...children) {
  const held = element.contains(document.activeElement) ? document.activeElement.id : "";
  element.replaceChildren();
  filled(element, {}, children);
  if (held) document.getElementById(held)?.focus({ preventScroll: true });
  return element;
}

/** The same, changed in place where only words and attributes differ: a selection and the keyboard's place stay. */
export function renew(element, fresh) {
  return element.firstChild && became(element.firstChild, fresh) ? element : put(element, fresh);
}

/** Makes a node what a fresh one is; false: it is built otherwise. */
function became(old, fresh) {
  if (old.nodeName !== fresh.nodeName || old.childNodes.length !== fresh.childNodes.length) return false;
  if (old instanceof Text && old.data !== fresh.data) old.data = fresh.data;
  for (const { name } of [...(old.attributes ?? [])]) if (!fresh.hasAttribute(name)) old.removeAttribute(name);
  for (const { name, value } of fresh.attributes ?? []) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  return [...fresh.childNodes].every((child, k) => became(old.childNodes[k], child));
}

/** A table from headings and rows of cells. */
export function table(caption, headings, rows) {
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption },
    h("table", {}, h("caption", {}, caption),
      h("thead", {}, h("tr", {}, headings.map((one) => h("th", { scope: "col" }, one)))),
      h("tbody", {}, rows.map((row) => h("tr", {}, row.map((cell, k) => (k ? h("td", {}, cell) : h("th", { scope: "row" }, cell))))))));
}

/** A button that tells what came of it beside itself. */
export function action(label, work, attributes = {}) {
  const said = h("span", { class: "said", role: "status" });
  const button = h("button", { type: "button", ...attributes, onclick: async () => {
    button.disabled = true;
    put(said, "…");
    try {
      put(said, (await work()) ?? "done");
    } catch (error) {
      put(said, h("strong", {}, error.message));
    }
    button.disabled = false;
  } }, label);
  return h("span", { class: "action" }, button, said);
}

/** A labelled field. */
export function field(label, control, hint) {
  return h("label", { class: "field" }, h("span", {}, label), control, hint && h("small", {}, hint));
}
