"use strict";

// A coefficient against run, load and time, with control limits. A chart is a slider: arrow keys select a run.

// With more runs the error bars would cover the plot.
const MOST_BARS = 300;
const KINDS = {
  ok: { class: "ok", symbol: "dot" },
  beyond: { class: "beyond", symbol: "diamond" },
  invalid: { class: "invalid", symbol: "cross" },
};

/** The charts, updated with the runs that the table shows. */
class Charts {
  constructor() {
    this.places = ABSCISSAE.map(() => el("div"));
    this.choice = el("select", { id: "coefficient", change: () => this.draw() },
      page.limits.map((limit, i) => el("option", { value: i }, label(limit))));
    this.source = el("p");
    this.section = el("section", { "aria-labelledby": "charts" },
      el("h2", { id: "charts" }, "Coefficients from run to run"),
      el("p", { class: "controls" }, el("label", { for: "coefficient" }, "Coefficient"), this.choice), this.source,
      el("div", { class: "figures" }, this.places));
  }

  update(selected) {
    this.selected = selected;
    this.draw();
  }

  draw() {
    const limit = page.limits[this.choice.value || 0];
    const law = column.friction;
    this.source.textContent = limit.sentence;
    const chosen = this.selected.filter((row) => !limit.law || law.text(row) === limit.law);
    ABSCISSAE.forEach((abscissa, i) => this.places[i].replaceChildren(chart(limit, abscissa, chosen)));
  }
}

const label = ({ name, law }) => (law && page.limits.some((other) => other.law !== law) ? `${name}, ${law}` : name);

/** Abscissas of a chart: the order of the table, and load and time if they differ between runs. */
const ABSCISSAE = (() => {
  const known = (name) => new Set(column[name]?.values.filter(Number.isFinite)).size > 1;
  return [
    { title: "run", label: "Run, in the order of the table", at: (row) => row + 1 },
    known("load") && { title: "load", label: column.load.head, at: (row) => column.load.values[row] },
    known("measured_at") && { title: "time", label: "Time (UTC)", at: (row) => column.measured_at.values[row], time: true },
  ].filter(Boolean);
})();

function chart(limit, abscissa, chosen) {
  const ordinate = column[limit.name];
  const drawn = chosen.filter((row) => Number.isFinite(ordinate.values[row]) && Number.isFinite(abscissa.at(row)));
  // Runs far beyond the limits are drawn at the edge; otherwise all others would collapse into a line.
  const reach = limit.high - limit.low;
  const inside = (value) => Math.min(Math.max(value, limit.low - reach), limit.high + reach);
  const outside = drawn.filter((row) => ordinate.values[row] !== inside(ordinate.values[row]));
  const kindOf = (row) => {
    if (column.status.text(row) !== "ok") return "invalid";
    return ordinate.values[row] < limit.low || ordinate.values[row] > limit.high ? "beyond" : "ok";
  };
  const of = (rows) => ({ x: rows.map(abscissa.at), y: rows.map((row) => inside(ordinate.values[row])) });
  const groups = Object.keys(KINDS).map((kind) => [kind, drawn.filter((row) => kindOf(row) === kind)]);
  const { x: across, y: values } = of(drawn);
  const drawing = plot({
    x: { label: abscissa.label, limits: limits([across]), time: abscissa.time },
    y: { label: ordinate.head, limits: limits([values, [limit.low, limit.high]], 0.08) },
    layers: [
      { band: [limit.low, limit.high], class: "band" },
      { level: limit.mean, class: "mean" }, { level: limit.low, class: "limit" }, { level: limit.high, class: "limit" },
      drawn.length <= MOST_BARS ? { ...of(drawn), bars: drawn.map((row) => ordinate.std[row]), class: "bars" } : null,
      ...groups.map(([kind, rows]) => ({ ...of(rows), ...KINDS[kind] })),
    ].filter(Boolean),
  });
  const beyond = groups.find(([kind]) => kind === "beyond")[1].length;
  const more = outside.length ? ` ${counted(outside.length, "run")} far beyond them ${outside.length > 1 ? "are" : "is"} drawn at the edge.` : "";
  const legend = groups.filter(([, rows]) => rows.length)
    .map(([kind, rows]) => [KINDS[kind], `${{ ok: "ok", beyond: "ok, beyond the limits", invalid: "invalid" }[kind]} (${count(rows.length)})`]);
  const readout = el("p", { class: "readout", "aria-hidden": "true" }, "Point at a run, or go from run to run with the arrow keys.");
  const made = figure(`${limit.name.replaceAll("_", " ")} against ${abscissa.title}`,
    `${counted(beyond, "ok run")} of those shown ${beyond === 1 ? "lies" : "lie"} beyond the lines.${more}`, drawing, legend);
  made.querySelector(".legend")?.before(readout);
  if (drawn.length) steer(drawing, drawn, across, values, readout, (row) => `${nameOf(row)}: ${limit.name} ${ordinate.read(row)}, ${column.status.text(row)}`);
  return made;
}

/** Selects points of a chart by keys and pointer; Enter or a click opens the run. */
function steer(drawing, drawn, across, values, readout, read) {
  const order = [...drawn.keys()].sort((a, b) => across[a] - across[b]);
  const cursor = svg("circle", { class: "cursor", r: 7, visibility: "hidden" });
  let at = -1;
  const go = (to) => {
    at = Math.min(Math.max(to, 0), order.length - 1);
    const point = order[at];
    fill(cursor, { cx: drawing.across(across[point]), cy: drawing.up(values[point]), visibility: "visible" }, []);
    const text = read(drawn[point]);
    readout.textContent = text;
    fill(drawing, { "aria-valuenow": at + 1, "aria-valuetext": text }, []);
  };
  const nearest = (event) => {
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
    let best = 0;
    let least = Infinity;
    order.forEach((point, i) => {
      const far = (drawing.across(across[point]) - place.x) ** 2 + (drawing.up(values[point]) - place.y) ** 2;
      if (far < least) [least, best] = [far, i];
    });
    return best;
  };
  const open = () => { location.hash = addressOf(drawn[order[at]]); };
  const jumps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10, Home: -Infinity, End: Infinity };
  fill(drawing, {
    class: "chart", role: "slider", tabindex: 0, "aria-valuemin": 1, "aria-valuemax": order.length, "aria-valuenow": 1,
    "aria-valuetext": `${counted(order.length, "run")}; arrow keys go from run to run, Enter opens one`,
    keydown: (event) => {
      if (event.key in jumps) go(at + jumps[event.key]);
      else if (event.key === "Enter" && at >= 0) open();
      else return;
      event.preventDefault();
    },
    pointermove: (event) => go(nearest(event)),
    click: (event) => { go(nearest(event)); open(); },
  }, [cursor]);
}
