"use strict";

// The table of runs with filters, sorting and pages. It remains fast with many runs, and a screen reader and a printer
// can handle it like any other table.

// Columns that the table shows in its first two columns, or not at all.
const APART = ["key", "file", "run", "status"];
const STATUSES = ["ok", "invalid", "rejected", "failed"];

class Runs {
  /** Calls `changed` with the shown rows, in their order, after each change. */
  constructor(changed) {
    this.changed = changed;
    this.filter = { text: "", statuses: null, reason: -1, range: { name: "", low: NaN, high: NaN } };
    this.sorting = { name: "", down: false };
    this.first = 0;
    this.size = 100;
    this.visible = columns.filter((each) => each.shown);
    this.head = el("tr");
    this.body = el("tbody");
    this.number = el("p", { role: "status", "aria-live": "polite" });
    this.pages = el("nav", { "aria-label": "Pages of the table", class: "controls" });
    this.section = el("section", { "aria-labelledby": "runs" }, el("h2", { id: "runs" }, "Runs"), this.controls(), this.number,
      el("div", { class: "wide", role: "region", tabindex: 0, "aria-labelledby": "runs" },
        el("table", { class: "runs", "aria-rowcount": rows + 1 },
          el("caption", {}, "One row per run and law. A name opens its run; a head sorts by its column."), el("thead", {}, this.head), this.body)),
      this.pages);
    this.drawHead();
  }

  controls() {
    const seen = [...new Set([...STATUSES, ...column.status.entry.words])].filter((word) => column.status.entry.words.includes(word));
    const tally = new Map();
    for (let row = 0; row < rows; row++) tally.set(column.status.text(row), (tally.get(column.status.text(row)) ?? 0) + 1);
    const boxes = seen.map((word) => el("label", {}, el("input", { type: "checkbox", checked: true, value: word, change: () => this.select() }), ` ${word} (${count(tally.get(word))})`));
    this.boxes = boxes.map((box) => box.firstChild);
    const numbers = columns.filter((each) => each.kind === "number" && each.values.some(Number.isFinite));
    this.text = el("input", { type: "search", id: "find", size: 24, input: () => this.select() });
    this.by = el("select", { id: "range", change: () => this.select() }, el("option", { value: "" }, "any"), numbers.map((each) => el("option", { value: each.name }, each.head)));
    const bound = (name) => el("input", { type: "number", step: "any", "aria-label": `${name} value of the column`, input: () => this.select() });
    [this.low, this.high] = [bound("Lowest"), bound("Highest")];
    this.reason = el("button", { type: "button", hidden: true, click: () => this.because(-1) }, "Show all reasons");
    const choices = columns.filter((each) => !APART.includes(each.name)).map((each) => el("label", {},
      el("input", { type: "checkbox", checked: each.shown, change: () => { each.shown = !each.shown; this.visible = columns.filter((one) => one.shown); this.drawHead(); this.draw(); } }), ` ${each.head}`));
    return el("div", { class: "controls", role: "search", "aria-label": "Filter the runs" },
      el("span", {}, el("label", { for: "find" }, "Find"), this.text),
      el("fieldset", {}, el("legend", {}, "Status"), boxes),
      el("span", {}, el("label", { for: "range" }, "Between"), this.by, this.low, el("span", { "aria-hidden": "true" }, "\u2013"), this.high),
      this.reason,
      el("details", {}, el("summary", {}, "Columns"), el("div", { class: "choices" }, choices)));
  }

  /** Shows only the runs with one reason of failure; -1: all runs. */
  because(reason) {
    this.filter.reason = reason;
    this.reason.hidden = reason < 0;
    this.select();
    this.section.scrollIntoView();
  }

  /** Filters and sorts the rows. */
  select() {
    const words = this.text.value.toLowerCase().split(/\s+/).filter(Boolean);
    const statuses = new Set(this.boxes.filter((box) => box.checked).map((box) => box.value));
    const bound = (input, otherwise) => (input.value === "" ? otherwise : input.valueAsNumber);
    const [low, high] = [bound(this.low, -Infinity), bound(this.high, Infinity)];
    const values = this.by.value ? column[this.by.value].values : null;
    const texts = columns.filter((each) => each.kind === "text" && each.name !== "sha256").map(matcher);
    const passes = (row) => statuses.has(column.status.text(row))
      && (this.filter.reason < 0 || reasonOf[row] === this.filter.reason)
      && (!values || (values[row] >= low && values[row] <= high))
      && words.every((word) => texts.some((has) => has(row, word)));
    this.rows = [];
    for (let row = 0; row < rows; row++) if (passes(row)) this.rows.push(row);
    this.sort();
  }

  sort() {
    const { name, down } = this.sorting;
    if (name) {
      const ranks = column[name].ranks;
      const sign = down ? -1 : 1;
      // Missing values come last in either order; equal values keep the order of the table.
      this.rows.sort((a, b) => (Number.isNaN(ranks[a]) - Number.isNaN(ranks[b])) || sign * (ranks[a] - ranks[b]) || a - b);
    } else this.rows.sort((a, b) => a - b);
    this.first = 0;
    this.draw();
    this.changed(this.rows);
  }

  drawHead() {
    const last = this.visible.filter((each) => ["outcome", "warnings"].includes(each.name));
    this.heads = [column.file, column.status, ...this.visible.filter((each) => !APART.includes(each.name) && !last.includes(each)), ...last];
    this.head.replaceChildren(...this.heads.map((each) => {
      const sorted = this.sorting.name === each.name;
      const button = el("button", { type: "button", click: () => {
        this.sorting = { name: each.name, down: this.sorting.name === each.name && !this.sorting.down };
        for (const other of this.head.children) other.removeAttribute("aria-sort");
        button.parentElement.setAttribute("aria-sort", this.sorting.down ? "descending" : "ascending");
        this.sort();
      } }, each === column.file ? "run" : each.head);
      return el("th", { scope: "col", class: each.kind === "number" ? "number" : null, "aria-sort": sorted ? (this.sorting.down ? "descending" : "ascending") : null }, button);
    }));
  }

  draw() {
    const shown = this.rows.slice(this.first, this.first + this.size);
    this.body.replaceChildren(...shown.map((row, i) => el("tr", { "aria-rowindex": this.first + i + 2 }, this.heads.map((each) => {
      if (each === column.file) return el("th", { scope: "row" }, el("a", { href: addressOf(row), id: `row-${row}` }, nameOf(row)));
      if (each === column.status) return el("td", {}, badge(each.text(row)));
      return el("td", { class: each.kind === "number" ? "number" : each.kind }, each.text(row));
    }))));
    const because = this.filter.reason < 0 ? "" : ` with the reason \u201c${page.reasons[this.filter.reason].reason}\u201d`;
    this.number.textContent = `${count(this.rows.length)} of ${counted(rows, "run")} shown${because}.`;
    this.drawPages();
  }

  drawPages() {
    const last = Math.max(0, Math.ceil(this.rows.length / this.size) - 1) * this.size;
    const turn = (text, to) => el("button", { type: "button", disabled: to === this.first || to < 0 || to > last, click: () => {
      this.first = to;
      this.draw();
      [...this.pages.querySelectorAll("button")].find((button) => button.textContent === text && !button.disabled)?.focus();
    } }, text);
    const end = Math.min(this.first + this.size, this.rows.length);
    const size = el("select", { id: "size", change: () => { this.size = Number(size.value); this.first = 0; this.draw(); } },
      [50, 100, 500].map((each) => el("option", { value: each, selected: each === this.size }, each)));
    this.pages.replaceChildren(turn("First", 0), turn("Previous", Math.max(this.first - this.size, 0)),
      el("span", {}, this.rows.length ? `Rows ${count(this.first + 1)} to ${count(end)} of ${count(this.rows.length)}` : "No row"),
      turn("Next", Math.min(this.first + this.size, last)), turn("Last", last),
      el("span", {}, el("label", { for: "size" }, "Rows on a page"), size));
  }
}

/** Returns a test for a word in the texts of a row; each distinct text is searched once. */
function matcher(each) {
  const lower = each.entry.words.map((word) => word.toLowerCase());
  const found = new Map();
  return (row, word) => {
    if (!found.has(word)) found.set(word, lower.map((text) => text.includes(word)));
    return found.get(word)[each.places[row]];
  };
}

const MARKS = { ok: "\u2713", invalid: "!", rejected: "\u00d7", failed: "\u00d7" };
const badge = (text) => el("span", { class: `badge ${STATUSES.includes(text) ? text : ""}` }, el("span", { "aria-hidden": "true" }, `${MARKS[text] ?? "?"} `), text);
