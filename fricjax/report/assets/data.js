"use strict";

// The data of the page: texts as JSON, numbers as base64 of their bytes, decoded at first use.

const page = JSON.parse(document.getElementById("data").textContent);

function bytes(base64) {
  const text = atob(base64);
  const found = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) found[i] = text.charCodeAt(i);
  return found.buffer;
}

/** A column of the table of runs. */
class Column {
  constructor(entry) {
    const { name, label, unit = "", kind, group, shown } = entry;
    Object.assign(this, { name, label, unit, kind, group, shown });
    this.head = unit ? `${label} [${unit}]` : label;
    this.entry = entry;
    this.decoded = {};
  }

  /** Numbers of all rows; NaN for a missing number. */
  get values() { return this.numbers("values"); }

  /** Standard errors of all rows. */
  get std() { return this.numbers("std"); }

  numbers(field) {
    this.decoded[field] ??= new Float64Array(bytes(this.entry[field]));
    return this.decoded[field];
  }

  get places() {
    this.decoded.at ??= new Uint32Array(bytes(this.entry.at));
    return this.decoded.at;
  }

  /** Text of a row. */
  text(row) {
    if (this.kind === "text") return this.entry.words[this.places[row]];
    const value = this.values[row];
    if (this.entry.text) return this.entry.text[row];
    if (this.kind === "time") return Number.isFinite(value) ? new Date(value).toISOString().slice(0, 16).replace("T", " ") : "";
    return number(value);
  }

  /** Text of a row with its unit. */
  read(row) { return this.withUnit(this.text(row)); }

  withUnit(text) {
    if (!text || !this.unit) return text;
    return text.includes(" (") ? text.replace(" (", ` ${this.unit} (`) : `${text} ${this.unit}`;
  }

  /** Sort keys of the rows; NaN for a missing value. */
  get ranks() {
    if (this.kind !== "text") return this.values;
    if (!this.decoded.ranks) {
      const words = this.entry.words;
      const collator = new Intl.Collator("en", { numeric: true });
      const order = [...words.keys()].sort((a, b) => collator.compare(words[a], words[b]));
      const rank = new Float64Array(words.length);
      order.forEach((word, i) => { rank[word] = words[word] === "" ? NaN : i; });
      this.decoded.ranks = Float64Array.from(this.places, (word) => rank[word]);
    }
    return this.decoded.ranks;
  }
}

const columns = (page.columns ?? []).map((entry) => new Column(entry));
const column = Object.fromEntries(columns.map((each) => [each.name, each]));
const rows = page.rows ?? 0;
const reasonOf = page.reasonOf ? new Int32Array(bytes(page.reasonOf)) : [];
const rowOf = new Map((page.keys ?? []).map((key, row) => [key, row]));

/** Name of a run: its file, and the number of the run in the file. */
const nameOf = (row) => [column.file, column.run].filter(Boolean).map((each) => each.text(row)).filter(Boolean).join(" \u00b7 ");

const addressOf = (row) => `#run=${encodeURIComponent(page.keys[row])}`;

const noises = page.pictures ? new Float32Array(bytes(page.pictures.noise)) : [];
const fittedFriction = page.pictures ? new Float32Array(bytes(page.pictures.fitted)) : [];
let block = { index: -1, buffer: null };

/** Curves of a run by name, as arrays of numbers; null without curves. */
function curvesOf(row) {
  const { sizes, runsPerBlock, curves } = page.pictures;
  if (!sizes[row]) return null;
  const index = Math.floor(row / runsPerBlock);
  if (block.index !== index) block = { index, buffer: bytes(document.getElementById(`block-${index}`).textContent) };
  let at = 0;
  for (let i = index * runsPerBlock; i < row; i++) at += sizes[i];
  const view = new DataView(block.buffer);
  const found = {};
  for (const name of curves) {
    const length = view.getUint32(at, true);
    const low = view.getFloat32(at + 4, true);
    const step = (view.getFloat32(at + 8, true) - low) / 65534;
    found[name] = Float64Array.from({ length }, (_, i) => {
      const level = view.getUint16(at + 12 + 2 * i, true);
      return level === 65535 ? NaN : low + step * level;
    });
    at += 12 + 4 * Math.ceil(length / 2);
  }
  return found;
}
