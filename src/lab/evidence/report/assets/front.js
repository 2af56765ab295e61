// --- the plane of attack and realism: one place a program, measured on one set of scenes
const SUITES = { held_out: "held-out scenes", pool: "the whole evolution pool", search: "what the search saw" };
// Programs of a lineage under the labels of a suite: { solution, objectives, spread, on, words, id }.
function planePoints(lineage, suite) {
  const chosen = lineage.result && lineage.result.evolved.solution, byProgram = new Map(data.attempts.filter((a) => a.lineage === lineage.id && a.solution).map((a) => [a.solution, a]));
  const point = (solution, objectives, on, more = [], spread = null) => {
    const a = byProgram.get(solution), roles = [solution === lineage.parent ? "parent" : "", solution === chosen ? "chosen" : "", ...more].filter(Boolean);
    return { solution, objectives, on, spread, a, id: a && a.id, parent: solution === lineage.parent, chosen: solution === chosen, words: roles.join(", ") };
  };
  if (suite === "held_out") return lineage.held_out.filter((h) => h.measured.coverage > 0).map((h) => point(h.measured.solution, h.measured.objectives, `${h.scenes} held-out scenes`, [], h.spread));
  if (suite === "pool") return (lineage.choice ? lineage.choice.rows : []).filter((r) => r.coverage > 0).map((r) => point(r.solution, r.objectives, `the whole evolution pool, ${lineage.choice.scenes} scenes`, [r.on_front ? "on the front" : "", plain(r.standing || "").replace(/^chosen$/, "")]));
  // Members of the front have labels of all windows; those take the place of the ones on the window of their epoch.
  const last = lineage.epochs[lineage.epochs.length - 1], seen = (lineage.windows[lineage.windows.length - 1] || [])[2], points = new Map();
  for (const p of lineage.parent_scores.slice(0, 1)) points.set(p.solution, point(p.solution, p.objectives, `the window of epoch ${p.epoch}`));
  for (const a of data.attempts) if (a.lineage === lineage.id && a.objectives) points.set(a.solution || a.id, { ...point(a.solution || a.id, a.objectives, `the window of epoch ${a.epoch}`, [standing(a)]), a, id: a.id });
  for (const p of last ? last.front : []) points.set(p.solution, point(p.solution, p.objectives, `the ${seen} scenes of all windows`, ["on the front"]));
  return [...points.values()];
}
// What other runs report in the place of this lineage's program; a kind of search that two runs share is told apart by their names.
function otherPoints(lineage) {
  const others = data.others || [], twice = (by) => others.filter((o) => o.by === by).length > 1;
  return others.flatMap((o, k) => o.points.filter((p) => p.lineage === lineage.id && p.measured.coverage > 0).map((p) => ({ solution: p.measured.solution, objectives: p.measured.objectives, on: `${p.scenes} held-out scenes`, spread: p.spread, run: o.name, kind: ["ring", "cross", "bar"][k % 3], text: twice(o.by) ? `${o.by} (${o.name})` : o.by })));
}
function dominated(p, points) { return points.some((q) => q.objectives.attack >= p.objectives.attack && q.objectives.realism >= p.objectives.realism && (q.objectives.attack > p.objectives.attack || q.objectives.realism > p.objectives.realism)); }
const shortId = (solution, lineage) => solution.startsWith(`${lineage.id}/`) ? solution.slice(lineage.id.length + 1) : solution;

function plane(place, lineage, suite, { most = 760, height = 420 } = {}) {
  const points = planePoints(lineage, suite), others = suite === "held_out" ? otherPoints(lineage) : [];
  if (!points.length) return place.replaceChildren(note("Nothing of this lineage was measured there.", data.sealed ? "" : " Held-out scenes are opened after the last epoch."));
  const width = room(place, most), key = points.filter((p) => p.parent || p.chosen), rule = data.safebench ? null : data.realism_min;
  const bars = points.flatMap((p) => p.spread && (p.parent || p.chosen) ? p.spread[1] : []), risers = points.flatMap((p) => p.spread && (p.parent || p.chosen) ? p.spread[0] : []);
  // Attack to the right and realism upwards, as in every figure of the paper.
  const attacks = [...points, ...others].map((p) => p.objectives.attack), realisms = [...points, ...others].map((p) => p.objectives.realism);
  const near = rule !== null && rule !== undefined && Math.abs(rule - Math.max(...realisms)) < 0.15 ? [rule] : [];
  const chart = axes(width, height, padded([...attacks, ...risers], 0.02, 0, 1), robust(realisms, [...[...key, ...others].map((p) => p.objectives.realism), ...bars, ...near], 0.004, 0, 1), data.safebench ? "attack: CR (1 − OS) →" : "attack →", `${STRICT()} →`);
  const { root, x, y, box } = chart, taken = [], lowest = chart.yRange[0];
  const inside = (p) => p.objectives.realism >= lowest - 1e-9, px = (p) => x(p.objectives.attack), py = (p) => y(Math.max(lowest, p.objectives.realism));
  if (near.length) {
    root.append(svg("rect", { class: "refused", x: box[0], y: y(rule), width: box[2] - box[0], height: Math.max(0, box[3] - y(rule)) }), svg("line", { class: "rule", x1: box[0], x2: box[2], y1: y(rule), y2: y(rule) }));
    const text = `rule: ${STRICT()} ≥ ${rule}`, w = 6.3 * text.length, base = y(rule) + 20 > box[3] ? y(rule) - 6 : y(rule) + 15;
    root.append(svg("text", { class: "dim", x: box[2] - 5, y: base, "text-anchor": "end" }, text));
    taken.push([box[2] - w - 8, base - 13, box[2], base + 4]);
  }
  root.append(svg("text", { class: "better", x: box[2] - 6, y: box[1] + 14, "text-anchor": "end" }, "better ↗"));
  taken.push([box[2] - 62, box[1], box[2], box[1] + 18]);
  const front = points.filter((p) => inside(p) && !dominated(p, points)).sort((a, b) => a.objectives.attack - b.objectives.attack);
  if (front.length > 1) root.append(svg("path", { class: "front", d: front.map((p, i) => `${i ? "L" : "M"}${px(p)},${py(p)}` + (i + 1 < front.length ? `L${px(p)},${py(front[i + 1])}` : "")).join("") }));
  const ordered = [...points].sort((a, b) => (a.parent || a.chosen ? 1 : 0) - (b.parent || b.chosen ? 1 : 0));
  let off = 0;
  for (const p of ordered) {
    const at = [px(p), py(p)];
    if (p.spread && (p.parent || p.chosen)) {
      const [[a0, a1], [r0, r1]] = p.spread;
      root.append(svg("path", { class: "spread", d: `M${x(a0)},${at[1]}L${x(a1)},${at[1]}M${at[0]},${y(Math.max(lowest, r0))}L${at[0]},${y(r1)}` }));
    }
    const pick = p.id ? { class: "pick", tabindex: 0, onclick: () => go({ tab: "attempts", attempt: p.id }), onkeydown: (e) => { if (e.key === "Enter") go({ tab: "attempts", attempt: p.id }); } } : { class: "still" };
    const mark = !inside(p) ? svg("path", { d: `M${at[0]},${at[1] - 1}l-5,-9h10Z`, fill: "var(--dim)", ...pick }) : p.chosen ? sign("star", ...at, 7, "var(--chosen)", pick) : p.parent ? sign("square", ...at, 6, "var(--ink)", pick) : p.a ? signOf(p.a, ...at, 5, pick) : sign("circle", ...at, 5, "var(--ink)", pick);
    if (!inside(p)) off += 1;
    mark.append(svg("title", {}, `${p.solution}${p.words ? ` (${p.words})` : ""}: attack ${fixed(p.objectives.attack, 3)}, ${STRICT()} ${fixed(p.objectives.realism, 4)}, measured on ${p.on}`));
    root.append(mark);
    taken.push([at[0] - 8, at[1] - 8, at[0] + 8, at[1] + 8]);
  }
  for (const p of others) {
    const at = [px(p), py(p)];
    if (p.spread) root.append(svg("path", { class: "spread", d: `M${x(p.spread[0][0])},${at[1]}L${x(p.spread[0][1])},${at[1]}M${at[0]},${y(Math.max(lowest, p.spread[1][0]))}L${at[0]},${y(p.spread[1][1])}` }));
    const mark = sign(p.kind, ...at, 6, "var(--rejected)", { class: "other" });
    mark.append(svg("title", {}, `${p.text}: ${p.solution} of ${p.run}: attack ${fixed(p.objectives.attack, 3)}, ${STRICT()} ${fixed(p.objectives.realism, 4)}, measured on ${p.on}`));
    root.append(mark);
    taken.push([at[0] - 8, at[1] - 8, at[0] + 8, at[1] + 8]);
  }
  const names = points.length <= 14 ? points.filter((p) => !p.parent && !p.chosen && inside(p)) : front.filter((p) => !p.parent && !p.chosen).slice(0, 6);
  const same = key.length === 1 && key[0].parent && key[0].chosen;
  labelled(chart, [...key.map((p) => ({ x: px(p), y: py(p), text: same ? "parent, which stays" : p.chosen ? `chosen: ${shortId(p.solution, lineage)}` : "parent", bold: true })), ...names.map((p) => ({ x: px(p), y: py(p), text: shortId(p.solution, lineage) })), ...others.map((p) => ({ x: px(p), y: py(p), text: p.text }))], taken);
  const played = data.replay.find((r) => r.suite === (suite === "held_out" ? "held_out" : "evolution") && r.ego === lineage.ego);
  place.replaceChildren(root, downloads(root, `front-${lineage.id}-${suite}`, [["program", "attack", STRICT(), "measured on", "standing"], ...points.map((p) => [p.solution, p.objectives.attack, p.objectives.realism, p.on, p.words]), ...others.map((p) => [p.solution, p.objectives.attack, p.objectives.realism, p.on, `${p.text}, run ${p.run}`])]),
    note({
      held_out: `Each program once, on the ${(points[0] || {}).on}, which were opened after the choice${near.length ? ", so that a chosen program may fall short of the rule here" : ""}.${bars.length ? " Bars: 95 % over scenes drawn anew; parent and chosen share their scenes, so the difference is surer than the bars look." : ""}${others.length ? " Named by their search: what other runs report." : ""}`,
      pool: "The programs among which the run chose, each measured on every scene of the evolution pool.",
      search: "Every evaluated program once: members of the front on the scenes of all windows, the others on the window of their epoch, so places of different windows are not strictly comparable.",
    }[suite], off ? ` ${counted(off, "program")} of lower ${STRICT()} at the lower edge (▾).` : "", played ? ` Without a program the ego crashes in ${fixed(100 * played.contact_rate, 1)} % of these scenes.` : ""));
}

function growthChart(place, lineage) {
  const grown = lineage.growth ? lineage.growth.points : [], searched = lineage.epochs.map((e) => [e.epoch, e.hypervolume]), all = [...grown, ...searched];
  if (!all.length) return place.replaceChildren(note("No epoch is finished yet."));
  const width = room(place, 560), chart = axes(width, 300, [Math.min(...all.map((p) => p[0])) - 0.3, Math.max(1, ...all.map((p) => p[0])) + 0.3], padded(all.map((p) => p[1]), 0.005, 0), "after epoch", "hypervolume");
  const line = (points, kind) => { if (points.length) chart.root.append(svg("path", { class: kind, d: points.map((p, i) => `${i ? "L" : "M"}${chart.x(p[0])},${chart.y(p[1])}`).join("") })); };
  line(searched, "growth seen"); line(grown, "growth");
  for (const p of grown) chart.root.append(sign("circle", chart.x(p[0]), chart.y(p[1]), 4, "var(--accent)"));
  for (const p of searched) chart.root.append(sign("ring", chart.x(p[0]), chart.y(p[1]), 3.4, "var(--dim)"));
  place.replaceChildren(chart.root, downloads(chart.root, `hypervolume-${lineage.id}`, [["epoch", "hypervolume", "scenes"], ...grown.map((p) => [...p, lineage.growth.scenes]), ...searched.map((p) => [...p, "all so far"])]),
    note(lineage.growth ? `Solid: area under the ${counted(lineage.growth.programs, "program")} that were measured on all ${lineage.growth.scenes} evolution scenes, as far as they were there (−1: the parent alone). It rests on the same scenes throughout, so it cannot fall. ` : "", "Hollow, dashed: what the search itself saw after each epoch, on the scenes used up to then. It falls where new scenes are harder, or where a program that led on few scenes does not on more."));
}
function drawFront() {
  const lineage = lineageOf(state.lineage) || bestLineage(), suite = SUITES[state.suite] ? state.suite : data.sealed ? "held_out" : "search", page = byId("front");
  const chart = el("div"), growth = el("div"), tree = el("div");
  put(page, part("Attack–realism front", lineageControls(lineage, el("label", {}, "Measured on ", el("select", { id: "front-suite", onchange: (e) => go({ suite: e.target.value }) }, Object.entries(SUITES).map(([value, words]) => option(value, words, value === suite))))),
    el("div", { class: "charts" }, el("figure", { id: "front-chart" }, chart), el("figure", { id: "hv-chart" }, el("h3", {}, "How the front grew"), growth)), signLegend()), choicePart(lineage), tree);
  fitting(() => plane(chart, lineage, suite)); fitting(() => growthChart(growth, lineage));
}
function lineageControls(lineage, ...more) {
  const choose = el("select", { id: "lineage-choice", onchange: (e) => go({ lineage: e.target.value }) }, data.lineages.map((l) => option(l.id, l.id, l === lineage)));
  return el("div", { class: "controls" }, data.lineages.length > 1 ? el("label", {}, "Lineage ", choose) : el("b", {}, lineage.id), ...more);
}
const signLegend = () => el("p", { class: "legend" }, ...[["star", "var(--chosen)", "chosen"], ["square", "var(--ink)", "parent"], ...Object.entries(SIGNS).map(([name, [kind, colour]]) => [kind, colour, name])].map(([kind, colour, name]) => el("span", { class: "key" }, small(kind, colour), name)));
// Why the lineage reports what it reports, and what everybody who was compared scores on the whole pool.
function choicePart(lineage) {
  const choice = lineage.choice;
  if (!choice) return null;
  return part(`Why ${choice.chosen}`, note(`Labels on the whole evolution pool, ${choice.scenes} scenes. Rule of the experiment: ${choice.rule}.`),
    sortable(["Program", "Attack", capital(STRICT()), "Coverage", "Any crash", "On the front", "Standing"], choice.rows.map((r) => [r.solution, [r.objectives.attack, 3], [r.objectives.realism, 4], [r.coverage, 2], [r.any_contact, 3], r.on_front ? "yes" : "no", plain(r.standing || "")]), `choice-${lineage.id}`),
    list([...choice.reasons, ...(choice.cut.length ? [`Not measured there, because the budget of finalists had no room for them: ${choice.cut.join(", ")}.`] : [])]));
}

// --- lineage tree: epochs from left to right, an edge from the parent that was edited
function drawLineage() {
  const lineage = lineageOf(state.lineage) || bestLineage(), attempts = data.attempts.filter((a) => a.lineage === lineage.id), chosen = chosenOf(lineage);
  const epochs = Math.max(0, ...attempts.map((a) => a.epoch)) + 1, slots = Math.max(0, ...attempts.map((a) => a.slot)) + 1, top = 46;
  const dx = Math.max(84, Math.min(170, 1040 / (epochs + 1))), dy = Math.max(15, Math.min(28, 620 / slots)), width = 70 + dx * epochs + 40, height = top + dy * slots + 8, middle = top + dy * (slots - 1) / 2;
  const at = (a) => [40 + dx * (a.epoch + 1), top + dy * a.slot], place = new Map([[lineage.parent, [40, middle]]]);
  for (const a of attempts) if (a.solution) place.set(a.solution, at(a));
  const bySolution = new Map(attempts.filter((a) => a.solution).map((a) => [a.solution, a])), chain = new Set();
  for (let of = bySolution.get(chosen); of && !chain.has(of.id); of = bySolution.get(of.parent)) chain.add(of.id);
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, style: `max-width:${width}px;min-width:${Math.min(width, 720)}px`, role: "img", "aria-label": `lineage ${lineage.id}` });
  for (let e = 0; e < epochs; e++) root.append(svg("text", { class: "dim", x: 40 + dx * (e + 1), y: 14, "text-anchor": "middle" }, `epoch ${e}`));
  for (const a of [...attempts].sort((a, b) => chain.has(a.id) - chain.has(b.id))) {
    const from = place.get(a.parent) || [40, middle], to = at(a);
    // A way over an epoch bends, so that it does not run through the signs of that epoch.
    const bend = to[0] - from[0] > 1.5 * dx ? 0.6 * dy : 0;
    root.append(svg("path", { class: chain.has(a.id) ? "edge chain" : "edge", d: `M${from[0]},${from[1]} C${from[0] + dx / 2},${from[1] + bend} ${to[0] - dx / 2},${to[1] + bend} ${to[0]},${to[1]}` }));
  }
  root.append(sign("square", 40, middle, 7, "var(--ink)"), svg("text", { x: 40, y: middle + 22, "text-anchor": "middle" }, "parent"));
  for (const a of attempts) {
    const open = () => go({ tab: "attempts", attempt: a.id }), pick = { class: "pick", tabindex: 0, onclick: open, onkeydown: (e) => { if (e.key === "Enter") open(); } };
    const node = a.solution && a.solution === chosen ? sign("star", ...at(a), 8, "var(--chosen)", pick) : signOf(a, ...at(a), 5.5, pick);
    node.append(svg("title", {}, `${a.id}: ${standing(a)}${a.objectives ? `, attack ${fixed(a.objectives.attack, 3)}, ${STRICT()} ${fixed(a.objectives.realism, 4)}` : ""}${a.hypothesis ? `\n${a.hypothesis}` : ""}`));
    root.append(node);
    if (chain.has(a.id)) root.append(svg("text", { class: "label bold", x: at(a)[0], y: at(a)[1] - 11, "text-anchor": "middle" }, `e${a.epoch}s${a.slot}`));
  }
  put(byId("lineage"), part("Lineage", lineageControls(lineage), ...(lineage.origins || []).map((origin) => note(`parent from ${origin}`)), el("div", { id: "tree" }, scroller(root)), signLegend(),
    note("Each sign is an attempt, epochs from left to right, an edge from the program that it edited. The thick way leads to the chosen program. Click a sign for its whole story.")));
}
