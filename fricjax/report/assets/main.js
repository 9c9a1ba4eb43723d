"use strict";

// The page: the report, and below it the runs, or one run if the address names it.

const main = document.getElementById("content");
const overview = el("div");
let runs = null;
let charts = null;
let left = { row: -1, scroll: 0 };

function report({ tables, heading, facts: lines, notes, warnings, errors }) {
  const sentences = [[errors, "error"], [warnings, "warning"], [notes, "note"]];
  return el("section", { "aria-label": heading },
    sentences.map(([texts, kind]) => texts.map((text) => el("p", { class: kind }, text))),
    el("div", { class: "tables" }, tables.map((each) => el("section", {}, each.title ? el("h3", {}, each.title) : null,
      table(each.title || `${each.columns[0]} and ${each.columns[1]}`, each.columns, each.rows, each.numeric)))),
    lines.length ? [el("h2", {}, heading), facts(lines)] : null);
}

function failures() {
  const examples = page.reasons.map((_, reason) => reasonOf.indexOf(reason));
  const lines = page.reasons.map(({ status, reason, runs: number }, i) => [reason, badge(status), count(number),
    el("a", { href: addressOf(examples[i]) }, nameOf(examples[i])),
    el("button", { type: "button", "aria-label": `Show the runs: ${reason}`, click: () => runs.because(i) }, "Show")]);
  return el("section", { "aria-labelledby": "reasons" }, el("h2", { id: "reasons" }, "Runs that are not ok, by reason"),
    table("Reasons", ["Reason", "Status", "Runs", "Example", "In the table"], lines, [false, false, true]));
}

function build() {
  document.getElementById("made").textContent = page.made;
  overview.append(report(page.report));
  if (rows === 1) overview.append(el("section", { "aria-labelledby": "pictures" }, el("h2", { id: "pictures" }, nameOf(0)), el("div", { class: "figures" }, figuresOf(0))));
  if (rows > 1) {
    if (page.limits.length) charts = new Charts();
    runs = new Runs((selected) => charts?.update(selected));
    if (charts) overview.append(charts.section);
    if (page.reasons.length) overview.append(failures());
    overview.append(runs.section);
    runs.select();
  }
  main.append(overview);
}

/** Shows the run that the address names, or all runs. */
function route() {
  const named = /^#run=(.+)$/.exec(location.hash);
  const row = named && rows > 1 ? rowOf.get(decodeURIComponent(named[1])) : undefined;
  main.querySelector("article")?.remove();
  if (row !== undefined) {
    if (!overview.hidden) left.scroll = scrollY;
    left.row = row;
    overview.hidden = true;
    main.append(runView(row, runs.rows));
    document.title = `${nameOf(row)} \u2013 ${page.title}`;
    scrollTo(0, 0);
    document.getElementById("name").focus({ preventScroll: true });
  } else if (overview.hidden) {
    overview.hidden = false;
    document.title = page.title;
    scrollTo(0, left.scroll);
    document.getElementById(`row-${left.row}`)?.focus({ preventScroll: true });
  }
}

build();
addEventListener("hashchange", route);
route();
