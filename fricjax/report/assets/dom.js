"use strict";

// Elements are made of tags, attributes and texts. The data are never parsed as HTML, so they cannot execute.

const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.flat(Infinity).filter((child) => child != null));
  return element;
}

const el = (tag, attributes = {}, ...children) => fill(document.createElement(tag), attributes, children);
const svg = (tag, attributes = {}, ...children) => fill(document.createElementNS(SVG, tag), attributes, children);

/** A number with at most `digits` significant digits; empty for a missing number. */
function number(value, digits = 6) {
  if (!Number.isFinite(value)) return "";
  const rounded = Number(value.toPrecision(digits));
  // Below 1e-4 an exponent is easier to read than leading zeros.
  return rounded !== 0 && Math.abs(rounded) < 1e-4 ? rounded.toExponential() : String(rounded);
}

/** A count with its digits in groups of three. */
const count = (value) => value.toLocaleString("en");

/** A count with its noun. */
const counted = (value, noun) => `${count(value)} ${noun}${value === 1 ? "" : "s"}`;

/** A table of texts or elements with heads; numbers are aligned right. Its caption is for screen readers. */
function table(caption, heads, rows, numeric = []) {
  const side = (i) => ({ class: numeric[i] ? "number" : null });
  return el("div", { class: "wide" },
    el("table", {},
      el("caption", { class: "heard" }, caption),
      el("thead", {}, el("tr", {}, heads.map((head, i) => el("th", { scope: "col", ...side(i) }, head)))),
      el("tbody", {}, rows.map((row) => el("tr", {}, row.map((cell, i) =>
        i ? el("td", side(i), cell) : el("th", { scope: "row", ...side(i) }, cell)))))));
}

/** A list of names and texts. */
function facts(pairs) {
  return el("dl", {}, pairs.map(([name, text]) => el("div", {}, el("dt", {}, name), el("dd", {}, text))));
}
