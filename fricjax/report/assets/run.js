"use strict";

// One run: results, pictures, and all its columns of the table.

const GROUPS = { record: "Record", fact: "Facts", judgement: "Quality of the fit", run: "Run", provenance: "Provenance" };
// Minimum samples per half-cycle for a velocity, and the number above which differences use more distant samples.
const [FEWEST, ENOUGH] = [8, 20];

function runView(row, selected) {
  const place = selected.indexOf(row);
  const neighbour = (step, text) => {
    const other = selected[place + step];
    return place >= 0 && other != null ? el("a", { href: addressOf(other), title: nameOf(other) }, text) : el("span", { class: "off" }, text);
  };
  const warnings = column.warnings?.text(row);
  return el("article", { "aria-labelledby": "name" },
    el("nav", { class: "controls", "aria-label": "Runs" }, el("a", { href: "#", id: "back" }, "\u2190 All runs"), neighbour(-1, "Previous"), neighbour(1, "Next"),
      place >= 0 ? el("span", {}, `${count(place + 1)} of ${count(selected.length)} shown`) : null),
    el("h2", { id: "name", tabindex: -1 }, nameOf(row)),
    el("p", {}, badge(column.status.text(row)), " ", column.outcome?.text(row) ?? ""),
    warnings ? el("p", { class: "warning" }, warnings) : null,
    el("div", { class: "tables" }, values("Parameters", row, "parameter"), values("Kinematics, which need no rig", row, "kinematics")),
    el("div", { class: "figures" }, figuresOf(row)),
    Object.entries(GROUPS).map(([group, title]) => {
      const shown = columns.filter((each) => each.group === group && !["file", "run", "status", "outcome", "warnings"].includes(each.name));
      const pairs = shown.map((each) => [each.label, each.read(row)]).filter(([, text]) => text !== "");
      return pairs.length ? [el("h3", {}, title), facts(pairs)] : null;
    }).flat());
}

function values(title, row, group) {
  const shown = columns.filter((each) => each.group === group && each.text(row) !== "");
  const heads = ["Name", "Value (combined uncertainty)", "Statistical"];
  return shown.length ? el("section", {}, el("h3", {}, title), table(title, heads, shown.map((each) => [each.label, each.read(row), each.withUnit(number(each.std[row], 2))]), [false, true, true])) : null;
}

/** Pictures of a run, or a sentence if there are none. */
function figuresOf(row) {
  const curves = curvesOf(row);
  if (!curves) return el("p", {}, "There are no pictures of this run.");
  return [trace(curves), residuals(curves, row), phasePlane(curves), forceMap(curves, row)].filter(Boolean);
}

const axis = (name, curve) => (page.pictures.units[curve] ? `${name} [${page.pictures.units[curve]}]` : name);
const time = (curves) => ({ label: "Time [s]", limits: limits([curves.t], 0.01) });

function trace(curves) {
  const { t, x, residual, reversal_t, reversal_x } = curves;
  const model = x.map((value, i) => value - page.pictures.residualUnit * residual[i]);
  const layers = [
    { x: t, y: x, class: "measured" },
    { x: t, y: model, class: "model" },
    { x: reversal_t, y: reversal_x, class: "reversal", symbol: "dot" },
  ];
  return figure(page.pictures.name, `${counted(t.length, "sample")} of the record about its equilibrium, the fitted motion on them, and ${counted(reversal_t.length, "reversal")}.`,
    plot({ x: time(curves), y: { label: axis(page.pictures.name, "x"), limits: limits([x]) }, layers }),
    [[layers[0], "measured"], [layers[1], "fit"], [layers[2], "reversals"]].filter(([, text]) => text !== "reversals" || reversal_t.length));
}

function residuals(curves, row) {
  const { t, residual } = curves;
  if (!residual.some(Number.isFinite)) return null;
  const noise = noises[row];
  const band = Number.isFinite(noise) && noise > 0 ? [-2 * noise, 2 * noise] : [];
  const sentence = band.length ? `Measured minus fit; the band is twice the noise of ${number(noise, 3)} ${page.pictures.units.residual}.` : "Measured minus fit.";
  return figure("Residuals", sentence, plot({
    x: time(curves), y: { label: axis("Residual", "residual"), limits: limits([residual, band]) },
    layers: [...(band.length ? [{ band, class: "band" }] : []), { level: 0, class: "mean" }, { x: t, y: residual, class: "residual" }],
  }));
}

function phasePlane({ t, x, reversal_t }) {
  const samples = t.length / (t.at(-1) - t[0]);
  const half = (reversal_t.at(-1) - reversal_t[0]) / (reversal_t.length - 1);
  if (!(samples * half >= FEWEST)) return null;
  const step = Math.max(1, Math.floor(samples * half / ENOUGH));
  // Slope at the middle sample of the parabola through three samples.
  const v = x.map((_, i) => {
    const [before, after] = [t[i] - t[i - step], t[i + step] - t[i]];
    return ((x[i + step] - x[i]) / after * before + (x[i] - x[i - step]) / before * after) / (before + after);
  });
  return figure("Phase plane", "Velocity, from the differences of the samples drawn, against displacement; a decay winds inwards clockwise.", plot({
    x: { label: axis(page.pictures.name, "x"), limits: limits([x]) },
    y: { label: `Velocity [${page.pictures.units.x}/s]`, limits: limits([v]) },
    layers: [{ x, y: v, class: "model" }],
  }));
}

function forceMap({ speed, friction }, row) {
  if (!speed.length || !friction.some(Number.isFinite)) return null;
  const fitted = fittedFriction[row];
  const name = page.pictures.frictionIsMu ? "mu" : "Dead band";
  const of = (sign) => {
    const chosen = [...speed.keys()].filter((i) => sign * speed[i] > 0);
    return { x: chosen.map((i) => Math.abs(speed[i])), y: chosen.map((i) => friction[i]) };
  };
  const layers = [{ ...of(1), class: "ok", symbol: "up" }, { ...of(-1), class: "beyond", symbol: "down" }];
  const level = Number.isFinite(fitted) ? [{ level: fitted, class: "mean" }] : [];
  const meaning = page.pictures.frictionIsMu ? "Mean friction of each half-cycle over the load" : "Mean friction of each half-cycle over the stiffness";
  const drawing = plot({
    x: { label: axis("Mean speed of the half-cycle", "speed"), limits: [0, limits([speed.map(Math.abs)])[1]] },
    y: { label: axis(name, "friction"), limits: limits([friction, level.length ? [0.98 * fitted, 1.02 * fitted] : []]) },
    layers: [...level, ...layers],
  });
  const made = figure("Friction of the half-cycles", `${meaning}, from its reversals, less the viscous loss, on a linear spring; the line is the fit.`, drawing,
    [[layers[0], "towards +"], [layers[1], "towards \u2212"]]);
  const heads = ["Half-cycle", axis("Mean velocity", "speed"), axis(name, "friction")];
  made.append(el("details", {}, el("summary", {}, "Numbers"),
    table("Half-cycles", heads, [...speed.keys()].map((i) => [String(i + 1), number(speed[i], 5), number(friction[i], 5)]), [true, true, true])));
  return made;
}
