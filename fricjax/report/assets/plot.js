"use strict";

// Plots as SVG: axes with ticks at round numbers, lines, dots and bands. The style sheet sets colours by class.

const FRAME = { width: 720, height: 270, left: 74, right: 14, top: 12, bottom: 46 };
const SECOND = 1000;
const DAY = 86400 * SECOND;
const SPANS = [SECOND, 10 * SECOND, 60 * SECOND, 600 * SECOND, 3600 * SECOND, 6 * 3600 * SECOND, DAY, 7 * DAY, 30 * DAY,
  91 * DAY, 365.25 * DAY, 3652.5 * DAY];
// Different symbols, so that colour is not the only difference between kinds of points.
const SYMBOLS = {
  dot: (x, y) => `M${x} ${y}h0`,
  cross: (x, y) => `M${x - 3} ${y - 3}l6 6m0 -6l-6 6`,
  diamond: (x, y) => `M${x} ${y - 5}l5 5l-5 5l-5 -5z`,
  up: (x, y) => `M${x - 4} ${y + 3}h8l-4 -7z`,
  down: (x, y) => `M${x - 4} ${y - 3}h8l-4 7z`,
};

/** Limits of the finite numbers in some arrays, with a margin relative to their span. */
function limits(arrays, margin = 0.04) {
  let low = Infinity;
  let high = -Infinity;
  for (const values of arrays) {
    for (const value of values) {
      if (value < low) low = value;
      if (value > high && value < Infinity) high = value;
    }
  }
  if (low > high) return [0, 1];
  const more = margin * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - more, high + more];
}

/** Round numbers between two limits. */
function ticks(low, high, wanted) {
  const rough = (high - low) / wanted;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((each) => each >= rough * 0.999);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(i * step);
  return found.map((value) => ({ value, text: number(value, Math.max(3, Math.ceil(Math.log10(Math.abs(high / step) || 1)) + 2)) }));
}

/** Round times between two limits [ms]. */
function instants(low, high, wanted) {
  const step = SPANS.find((span) => span >= (high - low) / wanted) ?? SPANS.at(-1);
  const [from, to] = step < 60 * SECOND ? [11, 19] : step < DAY ? [5, 16] : [0, 10];
  const found = [];
  for (let i = Math.ceil(low / step); i * step <= high; i++) {
    found.push({ value: i * step, text: new Date(i * step).toISOString().slice(from, to).replace("T", " ") });
  }
  return found;
}

/**
 * A plot. `x` and `y` have a label and their limits, `layers` are lines {x, y, class}, dots {x, y, class, symbol},
 * bars {x, y, bars, class}, levels {level, class} and
 * bands {band: [low, high], class}.
 */
function plot({ x, y, layers, attributes = {} }) {
  const { width, height, left, right, top, bottom } = { ...FRAME, height: attributes.height ?? FRAME.height };
  const across = (value) => left + ((value - x.limits[0]) / (x.limits[1] - x.limits[0])) * (width - left - right);
  const up = (value) => height - bottom - ((value - y.limits[0]) / (y.limits[1] - y.limits[0])) * (height - top - bottom);
  const base = height - bottom;
  const marks = (x.time ? instants : ticks)(...x.limits, x.time ? 5 : 7);
  const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", ...attributes, height: null },
    ticks(...y.limits, 5).map(({ value, text }) => [
      svg("line", { class: "grid", x1: left, x2: width - right, y1: up(value), y2: up(value) }),
      svg("text", { x: left - 8, y: up(value) + 4, "text-anchor": "end" }, text)]),
    marks.map(({ value, text }) => [
      svg("line", { class: "grid", x1: across(value), x2: across(value), y1: top, y2: base }),
      svg("text", { x: across(value), y: base + 17, "text-anchor": "middle" }, text)]),
    svg("text", { x: (left + width - right) / 2, y: height - 8, "text-anchor": "middle", class: "label" }, x.label),
    svg("text", { transform: `translate(14 ${(top + base) / 2}) rotate(-90)`, "text-anchor": "middle", class: "label" }, y.label),
    layers.map((layer) => drawn(layer, across, up, left, width - right)));
  return Object.assign(drawing, { across, up });
}

function drawn(layer, across, up, left, right) {
  const attributes = { class: layer.class };
  if (layer.band) {
    const [low, high] = layer.band.map(up);
    return svg("rect", { ...attributes, x: left, width: right - left, y: high, height: low - high });
  }
  if (layer.level != null) {
    return svg("line", { ...attributes, x1: left, x2: right, y1: up(layer.level), y2: up(layer.level) });
  }
  if (layer.bars) {
    const bar = (x, i) => `M${across(x)} ${up(layer.y[i] - layer.bars[i])}V${up(layer.y[i] + layer.bars[i])}`;
    return svg("path", { ...attributes, d: layer.x.map(bar).join("") });
  }
  return svg("path", { ...attributes, d: layer.symbol ? points(layer, across, up) : line(layer, across, up) });
}

/** A line, broken where a number is missing. */
function line({ x, y }, across, up) {
  let pen = "M";
  const parts = [];
  for (let i = 0; i < x.length; i++) {
    if (!Number.isFinite(y[i])) {
      pen = "M";
      continue;
    }
    parts.push(`${pen}${across(x[i]).toFixed(1)} ${up(y[i]).toFixed(1)}`);
    pen = "L";
  }
  return parts.join("");
}

/** Symbols in one path; at most one symbol per pixel. */
function points({ x, y, symbol }, across, up) {
  const places = new Set();
  for (let i = 0; i < x.length; i++) {
    if (Number.isFinite(x[i]) && Number.isFinite(y[i])) places.add(1e4 * Math.round(2 * across(x[i])) + Math.round(2 * up(y[i])));
  }
  return Array.from(places, (place) => SYMBOLS[symbol](Math.floor(place / 1e4) / 2, (place % 1e4) / 2)).join("");
}

/** A plot with a title, a legend, and a sentence below. */
function figure(title, sentence, drawing, legend = []) {
  const id = `figure-${(figure.made = (figure.made ?? 0) + 1)}`;
  fill(drawing, { "aria-labelledby": `${id} ${id}-text` }, []);
  const keys = legend.map(([kind, text]) => el("li", {},
    svg("svg", { viewBox: "0 0 22 12", class: "key", "aria-hidden": "true" },
      svg("path", { class: kind.class, d: kind.symbol ? SYMBOLS[kind.symbol](11, 6) : "M1 6h20" })), text));
  return el("figure", {}, el("h3", { id }, title), drawing, keys.length ? el("ul", { class: "legend" }, keys) : null,
    el("figcaption", { id: `${id}-text` }, sentence));
}
