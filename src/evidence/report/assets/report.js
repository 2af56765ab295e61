"use strict";
// Draws the report from the JSON beside it. All text goes in as text nodes, never as markup.
(async () => {
  const [data, stage, figures = []] = await EvoUnpack.whole(JSON.parse(document.getElementById("data").textContent));
  const byId = (id) => document.getElementById(id);
  const COLOURS = { evaluated: "#1a9e60", accepted: "#1f6fd6", promoted: "#8a3fd1", rejected: "#c98a10", invalid: "#d0473d", declined: "#8b949e" };

  function el(name, attributes = {}, ...children) {
    const node = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key === "class") node.className = value; else if (key.startsWith("on")) node.addEventListener(key.slice(2), value); else node.setAttribute(key, value);
    }
    for (const child of children.flat()) if (child !== null && child !== undefined) node.append(child);
    if (/^(th|h3|span|b)$/.test(name)) explain(node);
    return node;
  }
  // What a word means, from the glossary; "" where it has no entry.
  const meaning = (text) => data.terms[text.trim().toLowerCase()] || "";
  function explain(node) {
    const means = node.children.length ? "" : meaning(node.textContent);
    if (means) { node.title = means; node.classList.add("term"); }
  }
  function svg(name, attributes = {}, ...children) {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) node.addEventListener(key.slice(2), value); else node.setAttribute(key, value);
    }
    node.append(...children.flat());
    return node;
  }
  // Half away from zero, as in every other text of the program: toFixed alone makes 0.037 of 0.0375.
  const rounded = (value, digits) => Math.sign(value) * Math.round(Math.abs(value) * 10 ** digits) / 10 ** digits;
  const fixed = (value, digits) => value === null || value === undefined ? "–" : rounded(value, digits).toFixed(digits);
  const signed = (value, digits) => (value >= 0 ? "+" : "−") + fixed(Math.abs(value), digits);
  const STRICT = data.safebench ? "ARS" : "strict realism"; // the realism among the objectives
  const capital = (text) => text[0].toUpperCase() + text.slice(1);
  // As the acceptor: one of three gates, enough coverage, and labels that are not the parent's.
  const accepted = (a) => !!a.decision && a.decision.gates.coverage.holds && a.decision.gates.differing_scenes > 0 && [a.decision.gates.densification, a.decision.gates.local_push, a.decision.gates.parent_tradeoff].some((g) => g.holds);
  const standing = (a) => a.decision && a.decision.promoted ? "promoted" : accepted(a) ? "accepted" : a.exit;

  // --- header and result
  byId("title").textContent = data.name;
  document.title = `${data.name} – EvoDrive report`;
  const models = [...new Set(Object.values(data.models))].join(", ");
  byId("provenance").append(
    data.sealed ? "root " : "unfinished run, last event ", el("code", {}, data.root), el("br"),
    `proposals from: ${models} · adapter ${data.versions.adapter}, sim ${data.versions.sim}, eval ${data.versions.eval} · ${data.evolution_scenes} evolution and ${data.held_out_scenes} held-out scenes`);
  const card = (value, label) => el("div", { class: "card" }, el("b", {}, String(value)), el("span", {}, label));
  const count = (exit) => data.attempts.filter((a) => a.exit === exit).length;
  byId("cards").append(card(data.attempts.length, "attempts"), card(count("declined"), "declined"), card(count("invalid"), "invalid"), card(count("rejected"), "rejected by the router"), card(count("evaluated"), "evaluated"), card(data.attempts.filter(accepted).length, "accepted"), card(data.rollouts ?? "–", "rollouts"));

  function resultTable() {
    const rows = data.lineages.filter((l) => l.result);
    if (!rows.length) return byId("result-table").append("The run is not finished: no held-out result yet.");
    const groups = [["", 1], ["Parent", 5], ["Evolved", 5], ["Change", 2], ["Frontier", 1], ["", 1]];
    const fiveHeads = ["attack", "any crash", "realism", STRICT, "coverage"];
    const head = ["Lineage", ...fiveHeads, ...fiveHeads, "attack", STRICT, "PF-Area@3 %", "Chosen program"];
    const acted = (l, m) => (l.held_out.find((of) => of.measured.solution === m.solution) || {}).realism_acted ?? null;
    const five = (l, m) => [[m.objectives.attack, 3], [m.any_contact, 3], [acted(l, m), 4], [m.coverage > 0 ? m.objectives.realism : null, 4], [m.coverage, 2]];
    // The recorded scenes without a program stand under the parent's heads, above the lineages however these are sorted.
    const none = Array.from({ length: 8 }, () => [null, 0]);
    const nothing = (r) => [`no program, ${r.ego}`, [0, 3], [r.contact_rate, 3], [r.realism, 4], [null, 0], [0, 2], ...none, ""];
    const chosen = (r) => ({ by: r.evolved.solution, node: el("span", {}, el("code", {}, r.evolved.solution), " ", playButton(r.evolved.solution)) });
    const change = (value, digits) => [value, digits, signed(value, digits)];
    const line = (l) => { const r = l.result; return [r.lineage, ...five(l, r.parent), ...five(l, r.evolved), change(r.evolved.objectives.attack - r.parent.objectives.attack, 3),
      change(r.evolved.objectives.realism - r.parent.objectives.realism, 4), change(r.pf_area_at_3_pct, 1), chosen(r)]; };
    const file = ["lineage", ...["parent", "evolved", "change of"].flatMap((of) => fiveHeads.slice(0, of === "change of" ? 1 : 5).map((h) => `${of} ${h}`)), `change of ${STRICT}`, "PF-Area@3 %", "chosen program"];
    byId("result-table").append(sortable(head, rows.map(line), "result", { groups, file, pinned: data.replay.filter((r) => r.suite === "held_out").map(nothing) }));
    const estimate = (e, sign) => (sign ? signed(e.value, 3) : fixed(e.value, 3)) + (e.interval ? ` [${e.interval.map((x) => sign ? signed(x, 3) : fixed(x, 3)).join(", ")}]` : "");
    const compared = rows.filter((l) => l.compared).flatMap((l) => l.compared.quantities.map((q) => [l.id, q.quantity, q.scenes, estimate(q.first), estimate(q.second), estimate(q.difference, true)]));
    byId("compared").hidden = !compared.length;
    if (compared.length) byId("compared-table").append(sortable(["Lineage", "Quantity", "Paired scenes", "Parent", "Chosen", "Chosen − parent"], compared.map((row) => row.map((cell, i) => i === 2 ? [cell, 0] : cell)), "compared", { rowsAPage: 24 }));
    creditTable(rows.filter((l) => l.credit), estimate);
    byId("result-table").append(...data.unlabelled.map((told) => el("p", { class: "note" }, told)));
    const scenes = rows[0].result.held_out_scenes;
    byId("result-note").textContent = `Held-out labels on ${scenes} scenes, opened after the choice of programs. Attack is ${data.safebench ? "CR (1 − OS) over SafeBench's traffic families" : data.attack ? `the experiment's own measure, the mean over scenes of ${data.attack}` : "the share of scenes in which the ego fails by a contact that the experiment counts"}; any crash: the share of scenes in which the ego touches any road user. Realism is the mean over the scenes that a program acts in; ${data.safebench ? "ARS, SafeBench's adversarial realism score, is what the search uses" : "strict realism, which the search uses, is the smaller one of that and the mean over its successes"}; coverage is the share of scenes that it acts in. The first row is the recorded scenes without a program: the crashes of the ego in recorded traffic, and the realism of that traffic.` +
      (!data.scripted_roles.length ? "" : data.scripted_roles.length === Object.keys(data.models).length
        ? " Proposals came from the scripted stand-in, not from a language model: these numbers say nothing about LLM agents."
        : ` The scripted stand-in, which is not a language model, answered as ${data.scripted_roles.join(", ")}.`);
  }

  // What `credit` says in words, and its numbers. A patch that cannot be taken out alone has none.
  function creditTable(lineages, estimate) {
    byId("credit").hidden = !lineages.length;
    if (!lineages.length) return;
    const cells = (gain) => [gain, gain && gain.realism].map((of, i) => of ? estimate(i ? of : of.attack, true) : "–");
    // What a patch was to do, in its proposer's words; the operations stand in the list of attempts.
    const said = (name) => (data.attempts.find((a) => a.id === name) || {}).hypothesis;
    const short = (text) => text.length > 240 ? `${text.slice(0, 240)}…` : text;
    const line = (l) => [[l.id, "all", ...cells(l.credit.whole), "–", "–", `${l.credit.program} against ${l.credit.parent}`],
      ...l.credit.edits.map((e) => [l.id, e.name, ...cells(e.needed), ...cells(e.alone), short(said(e.name) || e.what.join("; "))])];
    const groups = [["", 2], ["Lost without it", 2], ["Alone on the parent", 2], ["", 1]];
    const file = ["lineage", "patch", ...["lost without it", "alone"].flatMap((of) => [`${of}: attack`, `${of}: realism`]), "what it was to do"];
    byId("credit-table").append(sortable(["Lineage", "Patch", "attack", "realism", "attack", "realism", "What it was to do"], lineages.flatMap(line), "credit", { groups, file, rowsAPage: 24 }));
    byId("credit-list").append(...lineages.flatMap((l) => l.credit.edits.map((e) => el("li", {}, e.says))));
  }

  // What the audit of the record found: `fsck` prints the same.
  function auditList() {
    const breaches = data.findings.filter((f) => f.gravity === "breach").length;
    byId("audit-note").textContent = !data.findings.length ? "No findings: the record is consistent and keeps the rules that every run must keep."
      : breaches ? `${breaches} breaches: the result cannot be trusted.` : "The record is sound. Notes for whoever uses the result:";
    byId("audit-list").append(...data.findings.map((f) => el("li", {}, `${f.gravity} (${f.check}) ${f.place}: ${f.what}`)));
  }
  function costTable() {
    const cost = data.cost;
    if (!cost) return byId("cost").remove();
    const wall = cost.lineages.reduce((sum, l) => sum + l.wall_s, 0);
    const head = ["Lineage", "Wall s", "Share", "Rollouts", "Rollout s", "Compiled", "Compile s", "Answers", "Model s", "Tokens in", "Tokens out"];
    const tokens = (n) => [n, 0, n ? n.toLocaleString("en") : "–"];
    const line = (l) => [l.lineage, [l.wall_s, 1], [wall ? 100 * l.wall_s / wall : null, 0, wall ? `${fixed(100 * l.wall_s / wall, 0)} %` : "–"], [l.rollouts, 0], [l.rollout_s, 1],
      [l.compiled, 0], [l.compile_s, 1], [l.answers, 0], [l.model_s, 1], tokens(l.input_tokens), tokens(l.output_tokens)];
    byId("cost-table").append(sortable(head, [...cost.lineages].sort((a, b) => b.wall_s - a.wall_s).map(line), "cost"));
    byId("cost-note").textContent = `${cost.simulated} rollouts simulated and ${cost.reused} read from the store in ${fixed(wall, 1)} s on ${cost.threads} threads. Times of rollouts, compiling and models are summed over threads; compiling includes a family's own search and the simulations in it. No result depends on these times.`;
  }

  // --- charts
  function axes(width, height, xRange, yRange, xLabel, yLabel) {
    const m = { left: 62, right: 14, top: 12, bottom: 40 };
    const x = (v) => m.left + (v - xRange[0]) / (xRange[1] - xRange[0]) * (width - m.left - m.right);
    const y = (v) => height - m.bottom - (v - yRange[0]) / (yRange[1] - yRange[0]) * (height - m.top - m.bottom);
    const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${yLabel} over ${xLabel}` });
    const ticks = (range, n) => { const step = niceStep((range[1] - range[0]) / n), out = []; for (let k = Math.ceil(range[0] / step - 1e-9); k * step <= range[1] + 1e-9; k++) out.push(k * step); return out; };
    const decimals = (range, n) => Math.max(0, Math.min(4, -Math.floor(Math.log10(niceStep((range[1] - range[0]) / n)) + 1e-9)));
    for (const t of ticks(xRange, width < 400 ? 4 : 6)) root.append(svg("line", { class: "grid", x1: x(t), x2: x(t), y1: m.top, y2: height - m.bottom }), svg("text", { class: "dim", x: x(t), y: height - m.bottom + 16, "text-anchor": "middle" }, t.toFixed(decimals(xRange, 6))));
    for (const t of ticks(yRange, 5)) root.append(svg("line", { class: "grid", x1: m.left, x2: width - m.right, y1: y(t), y2: y(t) }), svg("text", { class: "dim", x: m.left - 8, y: y(t) + 4, "text-anchor": "end" }, t.toFixed(decimals(yRange, 5))));
    root.append(svg("text", { x: (m.left + width - m.right) / 2, y: height - 6, "text-anchor": "middle" }, xLabel), svg("text", { x: 14, y: (height - m.bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(height - m.bottom) / 2})` }, yLabel));
    return { root, x, y };
  }
  // As wide as its place on a narrow window, so that labels keep their size.
  const wide = (id, most) => Math.max(280, Math.min(most, byId(id).clientWidth || most));
  function niceStep(raw) { const power = 10 ** Math.floor(Math.log10(raw)); const r = raw / power; return (r > 5 ? 10 : r > 2 ? 5 : r > 1 ? 2 : 1) * power; }
  function padded(values, least) { let lo = Math.min(...values), hi = Math.max(...values); const pad = Math.max((hi - lo) * 0.08, least); return [lo - pad, hi + pad]; }

  // Points of the plane under the labels that the reader chose. Those of different suites are never drawn together.
  const SUITES = { window: "each on the window of its epoch", pool: "whole evolution pool", held_out: "held-out scenes" };
  function planePoints(lineage, suite) {
    const point = (solution, objectives, mark, on, colour, id) => ({ solution, objectives, mark, on, colour, id });
    const told = (of) => data.attempts.find((a) => a.lineage === lineage.id && a.solution === of);
    const roles = (solution, more) => [solution === lineage.parent ? "parent" : "", lineage.result && lineage.result.evolved.solution === solution ? "chosen" : "", ...more].filter(Boolean).join(", ");
    const compared = (m, scenes, more) => { const a = told(m.solution); return point(m.solution, m.objectives, roles(m.solution, more), scenes, a ? COLOURS[standing(a)] : "var(--ink)", a && a.id); };
    if (suite === "pool") return (lineage.choice ? lineage.choice.rows : []).filter((r) => r.coverage > 0).map((r) => compared(r, `the whole evolution pool, ${lineage.choice.scenes} scenes`, [(r.standing || "").replaceAll("_", " "), r.on_front ? "on the front" : ""].filter((w) => w !== "chosen")));
    if (suite === "held_out") return lineage.held_out.filter((h) => h.measured.coverage > 0).map((h) => compared(h.measured, `${h.scenes} held-out scenes`, h.roles.filter((r) => r !== "parent" && r !== "active")));
    const window = (epoch) => { const w = lineage.windows.find((w) => w[0] === epoch); return `the window of epoch ${epoch}${w ? `, ${w[1]} scenes` : ""}`; };
    const children = data.attempts.filter((a) => a.lineage === lineage.id && a.objectives).map((a) => point(a.solution || a.id, a.objectives, roles(a.solution, [standing(a)]), window(a.epoch), COLOURS[standing(a)], a.id));
    return [...children, ...lineage.parent_scores.slice(0, 1).map((p) => point(p.solution, p.objectives, "parent", window(p.epoch), "var(--ink)", null))];
  }
  function drawFront() {
    const id = byId("front-lineage").value, suite = byId("front-suite").value;
    const lineage = data.lineages.find((l) => l.id === id);
    const last = lineage.epochs[lineage.epochs.length - 1], seen = lineage.windows[lineage.windows.length - 1];
    const points = planePoints(lineage, suite);
    const front = suite === "window" && last ? [...last.front].sort((a, b) => a.objectives.realism - b.objectives.realism) : [];
    const all = [...points, ...front].map((p) => p.objectives);
    byId("front-chart").replaceChildren(); byId("hv-chart").replaceChildren();
    drawChoice(lineage);
    byId("front-caption").textContent = {
      window: `Dots: every evaluated candidate, each measured on the scenes of its own epoch, so dots of different epochs were measured on different scenes (point at a dot to see which). Line and squares: the archive's front after the last epoch, measured on the scenes of all windows so far${seen ? ` (${seen[2]})` : ""}.`,
      pool: "The programs among which the run chose, each measured on every scene of the evolution pool.",
      held_out: "The programs in the result, measured on the held-out scenes, which were opened after the choice.",
    }[suite] + " Rings: parent and chosen program.";
    if (!all.length) return byId("front-chart").append("Nothing of this lineage was measured there.");
    const chart = axes(wide("front-chart", 620), 400, padded(all.map((o) => o.realism), 0.002), padded(all.map((o) => o.attack), 0.02), `${STRICT} R`, "attack A");
    if (front.length) {
      const line = front.map((p, i) => `${i ? "L" : "M"}${chart.x(p.objectives.realism)},${chart.y(p.objectives.attack)}` + (i + 1 < front.length ? `L${chart.x(p.objectives.realism)},${chart.y(front[i + 1].objectives.attack)}` : "")).join("");
      chart.root.append(svg("path", { d: line, fill: "none", stroke: "var(--accent)", "stroke-width": 1.6 }));
      for (const p of front) {
        const square = svg("rect", { x: chart.x(p.objectives.realism) - 4, y: chart.y(p.objectives.attack) - 4, width: 8, height: 8, fill: "var(--accent)" });
        square.append(svg("title", {}, `${p.solution} on the front: attack ${fixed(p.objectives.attack, 3)}, ${STRICT} ${fixed(p.objectives.realism, 4)}, measured on the ${seen ? seen[2] : ""} scenes of all windows so far`));
        chart.root.append(square);
      }
    }
    for (const p of points) {
      const pick = p.id ? { class: "pick", tabindex: 0, onclick: () => openAttempt(p.id), onkeydown: (e) => { if (e.key === "Enter") openAttempt(p.id); } } : {};
      const dot = svg("circle", { ...pick, cx: chart.x(p.objectives.realism), cy: chart.y(p.objectives.attack), r: 5, fill: p.colour, "fill-opacity": 0.85 });
      dot.append(svg("title", {}, `${p.solution}: attack ${fixed(p.objectives.attack, 3)}, ${STRICT} ${fixed(p.objectives.realism, 4)} (${p.mark}), measured on ${p.on}`));
      if (/parent|chosen/.test(p.mark)) chart.root.append(svg("circle", { cx: chart.x(p.objectives.realism), cy: chart.y(p.objectives.attack), r: 9, fill: "none", stroke: /parent/.test(p.mark) ? "var(--ink)" : COLOURS.promoted, "stroke-width": 2 }));
      chart.root.append(dot);
    }
    const played = data.replay.find((r) => r.suite === (suite === "held_out" ? "held_out" : "evolution") && r.ego === lineage.ego);
    byId("front-chart").append(chart.root, downloads(chart.root, `front-${lineage.id}-${suite}`, [["program", "attack", STRICT, "measured on", "standing"], ...points.map((p) => [p.solution, p.objectives.attack, p.objectives.realism, p.on, p.mark]), ...front.map((p) => [p.solution, p.objectives.attack, p.objectives.realism, `the ${seen ? seen[2] : ""} scenes of all windows so far`, "on the front"])]));
    if (played) byId("front-chart").append(el("p", { class: "note" }, `Replay (no program): not in this chart, because nothing acts; the ego crashes in ${fixed(100 * played.contact_rate, 1)} % of ${played.scenes} ${suite === "held_out" ? "held-out" : "evolution"} scenes.`));
    const hv = lineage.epochs.map((e) => [e.epoch, e.hypervolume]);
    if (!hv.length) return;
    const plot = axes(wide("hv-chart", 420), wide("hv-chart", 420) < 400 ? 260 : 400, [-0.3, Math.max(hv.length, 2) - 0.7], padded(hv.map((p) => p[1]), 0.005), "epoch", "hypervolume");
    plot.root.append(svg("path", { d: hv.map((p, i) => `${i ? "L" : "M"}${plot.x(p[0])},${plot.y(p[1])}`).join(""), fill: "none", stroke: "var(--accent)", "stroke-width": 2 }));
    for (const p of hv) { const dot = svg("circle", { cx: plot.x(p[0]), cy: plot.y(p[1]), r: 4, fill: "var(--accent)" }); dot.append(svg("title", {}, `epoch ${p[0]}: ${p[1].toFixed(5)}`)); plot.root.append(dot); }
    byId("hv-chart").append(plot.root, downloads(plot.root, `hypervolume-${lineage.id}`, [["epoch", "hypervolume"], ...hv]));
  }
  // Why the lineage reports what it reports, and what everybody who was compared scores on the whole pool.
  function drawChoice(lineage) {
    const choice = lineage.choice;
    byId("choice").hidden = !choice;
    if (!choice) return;
    byId("choice-head").textContent = `Why ${choice.chosen}`;
    byId("choice-note").textContent = `Labels on the whole evolution pool, ${choice.scenes} scenes. Rule of the experiment: ${choice.rule}.`;
    byId("choice-table").replaceChildren(sortable(["Program", "Attack", capital(STRICT), "Coverage", "Any crash", "On the front", "Standing"],
      choice.rows.map((r) => [r.solution, [r.objectives.attack, 3], [r.objectives.realism, 4], [r.coverage, 2], [r.any_contact, 3], r.on_front ? "yes" : "no", (r.standing || "").replaceAll("_", " ")]), `choice-${lineage.id}`));
    byId("choice-reasons").replaceChildren(...choice.reasons.map((r) => el("li", {}, r)), ...(choice.cut.length ? [el("li", {}, `Not measured there, because the budget of finalists had no room for them: ${choice.cut.join(", ")}.`)] : []));
  }

  // --- lists and figures to take away
  const csv = (rows) => rows.map((row) => row.map((cell) => /[",\n]/.test(String(cell)) ? `"${String(cell).replaceAll('"', '""')}"` : String(cell)).join(",")).join("\n") + "\n";
  function save(name, type, text) {
    const link = el("a", { href: URL.createObjectURL(new Blob([text], { type })), download: name });
    link.click(); setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
  // The picture with the colours that it is shown in: it stands without the page's style.
  function standalone(root) {
    const copy = root.cloneNode(true), shown = root.querySelectorAll("*");
    copy.querySelectorAll("*").forEach((node, i) => { const style = getComputedStyle(shown[i]); for (const key of ["fill", "stroke", "stroke-dasharray", "font-family", "font-size"]) if (node.tagName !== "title") node.setAttribute(key, style.getPropertyValue(key)); });
    copy.setAttribute("xmlns", "http://www.w3.org/2000/svg"); copy.removeAttribute("style");
    return new XMLSerializer().serializeToString(copy);
  }
  function downloads(root, name, rows) {
    const file = name.replace(/[^A-Za-z0-9_.-]+/g, "_"), button = (text, action) => el("button", { class: "save", onclick: action }, text);
    return el("p", { class: "saves" }, root ? button("SVG", () => save(`${file}.svg`, "image/svg+xml", standalone(root))) : null, root ? " " : null, button("CSV", () => save(`${file}.csv`, "text/csv", csv(rows))));
  }
  // A table whose heads sort, in pages. A cell is a text, { node, by } with what it sorts by, or a number as [value, digits, text] with what is shown in
  // place of the digits; a missing value stands last. `groups` are heads above the heads with their widths, `pinned` rows stay on top, `file` are the CSV's heads.
  function sortable(heads, rows, name, { rowsAPage = 50, groups = null, pinned = [], file = heads } = {}) {
    const number = (i) => rows.some((row) => Array.isArray(row[i])), value = (cell) => Array.isArray(cell) ? cell[0] : cell && cell.node ? cell.by : cell;
    let by = null, up = true, at = 0;
    const tbody = el("tbody"), count = el("span", { role: "status" }), before = el("button", { onclick: () => { at--; draw(); } }, "previous"), next = el("button", { onclick: () => { at++; draw(); } }, "next");
    const sort = (i) => { up = by === i ? !up : !number(i); by = i; at = 0; draw(); };
    const titles = heads.map((text, i) => el("th", { scope: "col", ...(number(i) ? { class: "num" } : {}) }, el("button", { class: "sort", title: [meaning(text), `sort by ${text.toLowerCase()}`].filter(Boolean).join(" – "), onclick: () => sort(i) }, text)));
    const nothing = (v) => v === null || v === undefined || v === "";
    const ordered = () => rows.map((row, i) => [value(row[by]), i, row]).sort(([x, i], [y, j]) => nothing(x) - nothing(y) || (x < y ? -1 : x > y ? 1 : 0) * (up ? 1 : -1) || i - j).map(([, , row]) => row);
    const numberCell = ([x, digits, text]) => el("td", { class: "num" }, text ?? fixed(x, digits));
    const textCell = (cell, i) => el("td", i === 0 && typeof cell === "string" && cell.length < 40 || /^[−+\d][\d.]* \[/.test(cell) ? { class: "name" } : {}, cell && cell.node ? cell.node : cell);
    const shown = (row, kind) => el("tr", kind ? { class: kind } : {}, row.map((cell, i) => Array.isArray(cell) ? numberCell(cell) : textCell(cell, i)));
    function draw() {
      const pages = Math.max(1, Math.ceil(rows.length / rowsAPage));
      tbody.replaceChildren(...pinned.map((row) => shown(row, "replay")), ...(by === null ? rows : ordered()).slice(at * rowsAPage, (at + 1) * rowsAPage).map((row) => shown(row)));
      titles.forEach((th, i) => by === i ? th.setAttribute("aria-sort", up ? "ascending" : "descending") : th.removeAttribute("aria-sort"));
      count.textContent = `page ${at + 1} of ${pages}`; before.disabled = at === 0; next.disabled = at + 1 >= pages;
    }
    draw();
    const text = (cell) => value(cell) ?? "", band = groups ? el("tr", {}, groups.map(([title, columns]) => el("th", { class: "group", colspan: columns }, title))) : null;
    return el("div", {}, el("table", {}, el("thead", {}, band, el("tr", {}, titles)), tbody),
      el("div", { class: "controls below" }, rows.length > rowsAPage ? [before, count, next] : null, downloads(null, name, [file, ...[...pinned, ...rows].map((row) => row.map(text))])));
  }

  // --- lineage tree: epochs from left to right, an edge from the parent that was edited
  const TREES_AT_ONCE = 12;
  function drawTree() {
    const one = byId("tree-lineage").value, chosen = data.lineages.filter((l) => !one || l.id === one);
    byId("tree").replaceChildren();
    for (const lineage of chosen) {
      const attempts = data.attempts.filter((a) => a.lineage === lineage.id);
      const epochs = Math.max(0, ...attempts.map((a) => a.epoch)) + 1, slots = Math.max(0, ...attempts.map((a) => a.slot)) + 1;
      const dx = Math.max(90, Math.min(170, 980 / (epochs + 1))), dy = 26, width = 90 + dx * epochs + 30, height = 44 + dy * slots;
      const place = new Map([[lineage.parent, [40, 30 + dy * (slots - 1) / 2]]]);
      for (const a of attempts) if (a.solution) place.set(a.solution, [40 + dx * (a.epoch + 1), 30 + dy * a.slot]);
      const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, style: `max-width:${width}px;min-width:${Math.min(width, 700)}px`, role: "img", "aria-label": `lineage ${lineage.id}` });
      for (let e = 0; e < epochs; e++) root.append(svg("text", { class: "dim", x: 40 + dx * (e + 1), y: 14, "text-anchor": "middle" }, `epoch ${e}`));
      for (const a of attempts) {
        const from = place.get(a.parent) || [40, 30], to = [40 + dx * (a.epoch + 1), 30 + dy * a.slot];
        const promoted = standing(a) === "promoted";
        root.append(svg("path", { d: `M${from[0]},${from[1]} C${from[0] + dx / 2},${from[1]} ${to[0] - dx / 2},${to[1]} ${to[0]},${to[1]}`, fill: "none", stroke: promoted ? COLOURS.promoted : "var(--line)", "stroke-width": promoted ? 2.4 : 1 }));
      }
      root.append(svg("circle", { cx: 40, cy: 30 + dy * (slots - 1) / 2, r: 7, fill: "var(--ink)" }));
      for (const a of attempts) {
        const node = svg("circle", { class: "pick", tabindex: 0, cx: 40 + dx * (a.epoch + 1), cy: 30 + dy * a.slot, r: a.solution === lineage.active ? 8 : 5.5, fill: COLOURS[standing(a)], onclick: () => openAttempt(a.id), onkeydown: (e) => { if (e.key === "Enter") openAttempt(a.id); } });
        node.append(svg("title", {}, `${a.id}: ${standing(a)}${a.objectives ? `, attack ${fixed(a.objectives.attack, 3)}, ${STRICT} ${fixed(a.objectives.realism, 4)}` : ""}`));
        root.append(node);
      }
      byId("tree").append(el("h3", {}, lineage.id), ...(lineage.origins || []).map((origin) => el("p", { class: "note" }, `parent from ${origin}`)), root);
    }
    byId("tree-legend").replaceChildren("Each dot is an attempt; click it for details.", ...Object.entries(COLOURS).flatMap(([name, colour]) => [el("i", { style: `background:${colour}` }), name]));
  }

  // --- attempts
  const columns = ["Attempt", "Exit", "Attack", capital(STRICT), "Predicted", "Edits", "Hypothesis"];
  // What a head sorts by; where there is nothing, the row stands last.
  const SORTED_BY = { Exit: (a) => standing(a), Attack: (a) => a.objectives && -a.objectives.attack, [capital(STRICT)]: (a) => a.objectives && -a.objectives.realism, Predicted: (a) => a.route && -a.route.predicted.attack };
  const ROWS_A_PAGE = 200;
  let sortedBy = "Attempt", page = 0;
  const head = (c, i) => el("th", i >= 2 && i <= 4 ? { class: "num" } : {}, c === "Attempt" || SORTED_BY[c] ? el("button", { class: "sort", title: [meaning(c), `sort by ${c.toLowerCase()}`].filter(Boolean).join(" – "), onclick: () => { sortedBy = c; page = 0; drawAttempts(); } }, c) : c);
  byId("attempt-table").querySelector("thead tr").append(...columns.map(head));
  function sorted(attempts) {
    const by = SORTED_BY[sortedBy];
    if (!by) return attempts;
    const nothing = (v) => v === undefined || v === null;
    const keyed = attempts.map((a, i) => [by(a), i, a]);
    return keyed.sort(([x, i], [y, j]) => nothing(x) - nothing(y) || (x < y ? -1 : x > y ? 1 : i - j)).map(([, , a]) => a);
  }
  const body = byId("attempt-table").querySelector("tbody");
  let open = null;

  function matches(a) {
    const text = byId("filter-text").value.trim().toLowerCase();
    const lineage = byId("filter-lineage").value, exit = byId("filter-exit").value;
    if (lineage && a.lineage !== lineage || exit && a.exit !== exit || byId("filter-accepted").checked && !accepted(a)) return false;
    return !text || [a.id, a.hypothesis, a.reason, ...(a.tags || []), ...(a.categories || []), a.target].join(" ").toLowerCase().includes(text);
  }
  function drawAttempts() {
    const shown = sorted(data.attempts.filter(matches));
    const pages = Math.max(1, Math.ceil(shown.length / ROWS_A_PAGE)), short = data.attempts.filter((a) => a.in_short).length;
    page = Math.min(page, pages - 1);
    byId("filter-count").textContent = `${shown.length} of ${data.attempts.length}` + (short ? `; ${short} that were not accepted are shown in short and can be searched by id only` : "");
    byId("pages").hidden = pages === 1;
    byId("page-now").textContent = `page ${page + 1} of ${pages}`;
    byId("page-before").disabled = page === 0; byId("page-next").disabled = page + 1 >= pages;
    body.replaceChildren(...shown.slice(page * ROWS_A_PAGE, (page + 1) * ROWS_A_PAGE).flatMap((a) => {
      const toggle = () => { open = open === a.id ? null : a.id; drawAttempts(); };
      const mark = standing(a) !== a.exit ? ` (${standing(a)})` : "";
      const row = el("tr", { class: "row", id: `attempt-${a.id}`, tabindex: 0, "aria-expanded": String(open === a.id), onclick: toggle, onkeydown: (e) => { if (e.key === "Enter") toggle(); } },
        el("td", {}, el("code", {}, a.id)), el("td", { class: `exit-${a.exit}` }, a.exit + mark),
        el("td", { class: "num" }, fixed(a.objectives && a.objectives.attack, 3)), el("td", { class: "num" }, fixed(a.objectives && a.objectives.realism, 4)),
        el("td", { class: "num" }, a.route ? `${fixed(a.route.predicted.attack, 2)} / ${fixed(a.route.predicted.realism, 3)}` : "–"),
        el("td", {}, (a.categories || []).map((c) => el("span", { class: "tag" }, String(c).replace("/", "")))), el("td", { class: "hyp" }, a.hypothesis || a.reason || ""));
      return open === a.id ? [row, el("tr", {}, el("td", { colspan: columns.length, class: "detail" }, detail(a)))] : [row];
    }));
  }
  function openAttempt(id) {
    byId("filter-text").value = ""; byId("filter-lineage").value = ""; byId("filter-exit").value = ""; byId("filter-accepted").checked = false;
    open = id; sortedBy = "Attempt"; page = Math.floor(Math.max(0, data.attempts.findIndex((a) => a.id === id)) / ROWS_A_PAGE); drawAttempts();
    document.getElementById(`attempt-${id}`)?.scrollIntoView({ block: "center" });
  }
  const list = (items) => el("ul", {}, items.map((i) => el("li", {}, i)));
  function detail(a) {
    if (a.in_short) return el("p", {}, "Shown in short, because the run is large. ", el("code", {}, `evodrive show ${a.id}`), " tells the whole: prompts, replies, reviews, gates, route, labels.");
    const left = [el("h3", {}, "Asked for"), el("p", {}, a.target)];
    if (a.reason) left.push(el("h3", {}, "Declined"), el("p", {}, a.reason));
    if (a.memory && a.memory.length) left.push(el("h3", {}, "Memory shown"), el("p", { class: "mono" }, a.memory.join(", ")));
    left.push(el("h3", {}, "Reviews"));
    a.reviews.forEach((round, i) => round.forEach(([role, decision, blockers]) => left.push(el("p", {}, `round ${i} · ${data.roles[role].replace("_", " ")}: `, el("b", { class: decision === "approve" ? "pass" : "fail" }, decision)), blockers.length ? list(blockers) : null)));
    if (a.gates) left.push(el("h3", {}, "Gates"), ...a.gates.map(([gate, problems]) => el("p", {}, `${gate}: `, el("b", { class: problems.length ? "fail" : "pass" }, problems.length ? "failed" : "passed"), problems.length ? list(problems) : null)));
    if (a.route) left.push(el("h3", {}, "Route"), el("p", {}, `${a.route.decision}: ${a.route.reason}; uncertainty ${fixed(a.route.uncertainty, 3)}`));
    if (a.decision) {
      const g = a.decision.gates, d = g.densification, l = g.local_push, t = g.parent_tradeoff;
      const error = (value, digits) => value === null || value === undefined ? "" : ` ± ${value.toFixed(digits)}`;
      left.push(el("h3", {}, "Archive"), list([
        `over ${g.scenes} paired scenes, ${g.differing_scenes} of them with other labels than the parent's`,
        `coverage floor ${g.coverage.holds ? "holds" : "no"}: acts in ${fixed(g.coverage.coverage, 3)}, at least ${fixed(g.coverage.floor, 3)}`,
        `densification ${d.holds ? "holds" : "no"}: non-dominated ${d.non_dominated}, hypervolume ${fixed(d.hypervolume_before, 5)} ${signed(d.hypervolume_gain, 5)}${error(d.uncertainty, 5)}`,
        `local push ${l.holds ? "holds" : "no"}: best attack at r0 ${fixed(l.best_attack_at_r0, 3)}, best ${STRICT} at a0 ${fixed(l.best_realism_at_a0, 4)}`,
        `parent trade-off ${t.holds ? "holds" : "no"}: attack ${signed(t.attack_change, 3)}${error(t.attack_uncertainty, 3)}, ${STRICT} ${signed(t.realism_change, 4)}${error(t.realism_uncertainty, 4)}`]));
    }
    const right = [];
    if (a.diff) right.push(el("h3", {}, "Change of the program"), el("pre", { class: "diff" }, a.diff.split("\n").map((line) => el("span", { class: line.startsWith("+") ? "add" : line.startsWith("-") ? "del" : line.startsWith("@@") ? "hunk" : "" }, line + "\n"))));
    else if (a.operations) right.push(el("h3", {}, "Patch"), el("pre", { class: "diff" }, JSON.stringify(a.operations, null, 2)));
    if (a.scenes) right.push(el("h3", {}, "Scenes"), el("div", { class: "wide" }, el("table", {}, el("thead", {}, el("tr", {}, el("th", {}, "Scene"), el("th", { class: "num" }, "Attack"), el("th", { class: "num" }, "Realism"), data.metrics.map((name) => el("th", { class: "num" }, name)), el("th", {}, "Below 1"))),
      el("tbody", {}, a.scenes.map(([scene, attack, realism, applied, below, measured = []]) => el("tr", {}, el("td", {}, data.scenes[scene] + (applied ? " " : " (not applied) "), playButton(a.solution, data.scenes[scene])), el("td", { class: "num" }, fixed(attack, 2)), el("td", { class: "num" }, fixed(realism, 4)), measured.map((value) => el("td", { class: "num" }, value === null ? "" : fixed(value, 3))), el("td", {}, below.map(([n, d]) => `${data.diagnostics[n]} ${d.toFixed(3)}`).join(", "))))))));
    if (a.failures && a.failures.length) right.push(el("h3", {}, "Scenes without a label"), list(a.failures.map((f) => `${f.scene}: ${f.reason}`)));
    right.push(el("h3", {}, "Exchanges"), list(a.exchanges.map(([role, round, model, request, response, refusal]) => `${data.roles[role]} round ${round} (${data.model_names[model]}) request ${request} response ${response}${refusal ? ` – refused: ${refusal}` : ""}`)));
    return el("div", { class: "two" }, el("div", {}, left), el("div", {}, right));
  }

  // --- counsel: who was advised to attack in a scene, and how that was found
  const COUNSEL_A_PAGE = 40;
  function counselRound(round) {
    const distance = round.outcome === "contact" || round.distance_m === null ? "" : `, nearest ${fixed(round.distance_m, 1)} m`;
    return el("li", {}, el("code", {}, round.attackers.join(", ")), " ", el("b", { class: round.outcome === "contact" ? "pass" : "fail" }, round.outcome.replace("_", " ")), distance,
      round.by === "rules" ? " (by the rules)" : "", el("br"), el("span", { class: "note" }, round.reason));
  }
  function drawCounsel() {
    const text = byId("counsel-text").value.trim().toLowerCase(), lineage = byId("counsel-lineage").value;
    const says = (c) => [c.scene, ...c.rounds.flatMap((r) => [...r.attackers, r.outcome, r.outcome.replace("_", " "), r.by])].join(" ").toLowerCase();
    const shown = data.counsels.filter((c) => c.lineage === lineage && (!text || says(c).includes(text)));
    const refusals = (c) => c.exchanges.filter((x) => x.refusal).map((x) => el("li", {}, el("span", { class: "note" }, `round ${x.round}: answer not used: ${x.refusal}`)));
    byId("counsel-count").textContent = `${shown.length} scenes`;
    const sets = (c) => ({ by: c.rounds.length ? c.rounds.length + (c.rounds.some((r) => r.outcome === "contact") ? 0 : 1000) : null, node: c.rounds.length ? el("ol", {}, c.rounds.map(counselRound), refusals(c)) : el("span", {}, "no vehicle can attack") });
    const advised = (c) => ({ by: (c.advised || []).join(", "), node: el("code", {}, (c.advised || []).join(", ") || "nobody") });
    byId("counsel-table").replaceChildren(sortable(["Scene", "Sets tried, and their outcome", "Advised"], shown.map((c) => [c.scene, sets(c), advised(c)]), `counsel-${lineage}`, { rowsAPage: COUNSEL_A_PAGE, file: ["scene", "sets tried, 1000 more where none met the ego", "advised"] }));
    const all = data.counsels.filter((c) => c.lineage === lineage), met = (c) => c.rounds.some((r) => r.outcome === "contact");
    byId("counsel-note").textContent = `The attacker agent named attackers for each scene before any program was tried in it; each set was tried with the parent program, without that program's own search. ${all.filter(met).length} of ${all.length} advised sets led to contact with the ego, ${all.filter((c) => c.rounds.length && c.rounds[0].outcome === "contact").length} of them at the first try.`;
  }
  function openCounsel() {
    if (!data.counsels.length) return;
    byId("counsel").hidden = byId("counsel-link").hidden = false;
    byId("counsel-lineage").append(...[...new Set(data.counsels.map((c) => c.lineage))].map((id) => option(id, id)));
    for (const id of ["counsel-text", "counsel-lineage"]) byId(id).addEventListener("input", drawCounsel);
    drawCounsel();
  }

  // --- evolution: what the world agent proposed, and what the judge made of it
  function openEvolution() {
    const found = data.evolution;
    if (!found) return;
    byId("evolution").hidden = byId("evolution-link").hidden = false;
    byId("evolution-note").textContent = `${found.turns.length} turns: ${found.promoted} promoted, ${found.rejected} rejected, ${found.refused} without a usable change; ${found.refused_answers} answers were refused. Both configurations are measured on candidates of epochs that neither was fitted to; numbers are active → proposed.`;
    const said = (changes) => Object.entries(changes).map(([key, value]) => `${key} = ${JSON.stringify(value)}`).join(", ");
    const number = (value, digits) => value === null || value === undefined ? "–" : fixed(value, digits);
    const pair = (turn, name, digits) => el("td", { class: "num" }, turn.judgement ? `${number(turn.judgement.incumbent[name], digits)} → ${number(turn.judgement.challenger[name], digits)}` : "");
    byId("evolution-table").querySelector("tbody").replaceChildren(...found.turns.map((turn) => el("tr", {},
      el("td", {}, String(turn.epoch)), el("td", {}, el("code", {}, said(turn.changes) || "none")), el("td", {}, el("b", { class: turn.verdict === "promoted" ? "pass" : "fail" }, turn.verdict)),
      pair(turn, "rank_correlation", 3), pair(turn, "realism_error", 3), pair(turn, "coverage_pct", 1), pair(turn, "false_reject_pct", 2),
      el("td", {}, [...turn.refusals.map((why) => `refused: ${why}`), ...(turn.judgement ? turn.judgement.objections.map((o) => o.says) : [])].join("; ")))));
    byId("evolution-active").querySelector("tbody").replaceChildren(...found.active.map((row) => el("tr", {},
      el("td", {}, String(row.from_epoch)), el("td", { class: "mono" }, row.configuration.slice(0, 12)), el("td", {}, el("code", {}, said(row.changes) || "as the experiment says")))));
  }

  // --- figures as `evodrive figure` draws them: pictures, so that nothing in them can act
  function openFigures() {
    byId("figures").hidden = !figures.length;
    byId("figures-list").append(...figures.map(({ title, svg: text }) => {
      const name = title.replace(/[^A-Za-z0-9_.-]+/g, "_");
      return el("figure", {}, el("img", { src: `data:image/svg+xml,${encodeURIComponent(text)}`, alt: title, class: "sheet" }),
        el("figcaption", {}, `${title} `, el("button", { class: "save", onclick: () => save(`${name}.svg`, "image/svg+xml", text) }, "SVG")));
    }));
  }
  openFigures();

  // --- agreement: the same rollouts in another simulator
  const CAUSES = {
    start: "the contact lies within the first step: boxes overlapped from the start", ended_before: "the other rollout was over by then: the ego had arrived or left its route",
    partner_absent: "the road user that the ego touched is not on the road in the other rollout at that time", ego_elsewhere: "the egos were more than 1 m apart",
    near_miss: "the other came nearer than 0.3 m", untold: "none of the other causes",
  };
  const KINDS = { all: "", program: "By program", family: "By family", cluster: "By scene cluster", proposal: "Programs proposed in the run that no other row counts" };
  const percent = (i) => `${fixed(100 * i.value, 1)} [${fixed(100 * i.low, 1)}, ${fixed(100 * i.high, 1)}]`;
  const td = (text, number = true) => el("td", number ? { class: "num" } : {}, String(text));
  const heads = (names, texts = 1) => el("tr", {}, names.map((name, i) => el("th", i >= texts ? { class: "num" } : {}, name)));
  function agreementRows(rows) {
    const below = (text) => el("span", { class: "range" }, text);
    const apart = (a) => el("td", { class: "num" }, a.median_m === null ? "–" : [fixed(a.median_m, 2), below(fixed(a.p90_m, 2))]);
    const names = ["Rollouts of", "n", "both", "first only", "second only", "neither", "agree %", "kappa", "same partner", "apart s", "ego m, 1 s", "3 s", "5 s"];
    const ranged = (i, digits, scale) => el("td", { class: "num" }, i ? [fixed(scale * i.value, digits), below(`${fixed(scale * i.low, digits)} to ${fixed(scale * i.high, digits)}`)] : "–");
    const line = (r) => el("tr", {}, el("td", { class: "name" }, r.row), td(r.rollouts), r.confusion.map((n) => td(n)), ranged(r.agreement, 1, 100), ranged(r.kappa, 2, 1),
      td(r.confusion[0] ? `${r.same_partner} of ${r.confusion[0]}` : "–"), td(fixed(r.contact_time_apart_s, 2)), r.ego_apart.map(apart));
    const body = rows.flatMap((r, i) => i && rows[i - 1].of !== r.of ? [el("tr", { class: "head" }, el("th", { colspan: names.length }, KINDS[r.of])), line(r)] : [line(r)]);
    return el("table", {}, el("thead", {}, heads(names)), el("tbody", {}, body));
  }
  function agreementChart(rows) {
    const shown = rows.filter((r) => r.of === "program" || r.of === "family" || r.of === "cluster"), dy = 22, left = 170, width = 620, right = 20, top = 8;
    const least = Math.min(0.5, ...shown.map((r) => r.agreement.low)), height = top + dy * shown.length + 34;
    const x = (v) => left + (v - least) / (1 - least) * (width - left - right), bottom = height - 26;
    const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": "agreement by program, family and cluster" });
    for (let t = Math.ceil(10 * least); t <= 10; t++) root.append(svg("line", { class: "grid", x1: x(t / 10), x2: x(t / 10), y1: top, y2: bottom }), svg("text", { class: "dim", x: x(t / 10), y: bottom + 18, "text-anchor": "middle" }, `${10 * t} %`));
    root.append(svg("line", { class: "goal", x1: x(rows[0].agreement.value), x2: x(rows[0].agreement.value), y1: top, y2: bottom }));
    shown.forEach((r, i) => {
      const y = top + dy * (i + 0.5), { value, low, high } = r.agreement, prefix = r.of === "program" ? "" : `${r.of} `;
      const mark = svg("g", {}, svg("line", { x1: x(low), x2: x(high), y1: y, y2: y, stroke: "var(--accent)", "stroke-width": 2 }), svg("circle", { cx: x(value), cy: y, r: 4.5, fill: "var(--accent)" }));
      mark.append(svg("title", {}, `${prefix}${r.row}: ${percent(r.agreement)} %, n = ${r.rollouts}`));
      root.append(svg("text", { x: left - 10, y: y + 4, "text-anchor": "end" }, `${prefix}${r.row}`), mark);
    });
    return root;
  }
  function drawDisagreements() {
    const cause = byId("agreement-cause").value, program = byId("agreement-program").value;
    const all = data.agreement.disagreements, shown = all.filter((d) => (!cause || d.cause === cause) && (!program || d.program === program));
    byId("agreement-count").textContent = `${shown.length} of ${all.length}`;
    byId("agreement-cause-note").textContent = cause ? `${cause.replace("_", " ")}: ${CAUSES[cause]}.` : "The cause shown is the first of six that fits the recorded motion.";
    const name = ["first", "second"], metres = (value) => fixed(value, 2);
    byId("agreement-list").replaceChildren(el("table", {},
      el("thead", {}, heads(["Program", "Scene", "Contact in", "With", "Cause", "The other ended", "At s", "Nearest m", "Egos apart m"], 6)),
      el("tbody", {}, shown.map((d) => el("tr", {}, td(d.program, false), td(d.scene, false), td(data.agreement.backends[name.indexOf(d.contact_in)], false), td(d.with.with + (d.with.adversary ? " (adversary)" : ""), false),
        td(d.cause.replace("_", " "), false), td(d.other_end.replace("_", " "), false), td(fixed(d.with.at_cs / 100, 2)), td(metres(d.other_distance_m_min)), td(metres(d.ego_apart_m)))))));
  }
  function openAgreement() {
    const agreement = data.agreement;
    if (!agreement) return;
    byId("agreement").hidden = byId("agreement-link").hidden = false;
    const [first, second] = agreement.backends, all = agreement.rows[0], [both, one, other, neither] = all.confusion;
    byId("agreement-note").textContent = `First: ${first}. Second: ${second}. The same ${agreement.same_commands ? "rollouts in both" : "programs in both; each plans with its own simulation of the ego, so the commands differ"}.` +
      (agreement.left_out.length ? ` ${agreement.left_out.length} rollouts are left out, because only one of the two runs has them.` : "");
    byId("agreement-cards").append(card(`${fixed(100 * all.agreement.value, 1)} %`, `agree, of ${all.rollouts} rollouts`), card(all.kappa ? fixed(all.kappa.value, 2) : "–", "Cohen's kappa" + (all.kappa ? `, ${fixed(all.kappa.low, 2)} to ${fixed(all.kappa.high, 2)}` : "")),
      card(`${all.same_partner} of ${both}`, "contacts with the same partner"), card(`${fixed(all.contact_time_apart_s, 2)} s`, "between contacts, median"));
    byId("agreement-chart").append(agreementChart(agreement.rows));
    const cell = (n, same) => el("td", { class: same ? "num same" : "num" }, String(n)), side = (text) => el("th", {}, text);
    byId("agreement-confusion").append(el("table", {}, el("thead", {}, heads(["", "second: contact", "none"])),
      el("tbody", {}, el("tr", {}, side("first: contact"), cell(both, true), cell(one, false)), el("tr", {}, side("none"), cell(other, false), cell(neither, true)))));
    byId("agreement-apart").append(el("table", {}, el("thead", {}, heads(["Before", "median m", "90 % below m", "n"])),
      el("tbody", {}, all.ego_apart.map((a) => el("tr", {}, td(`${a.before_s} s`, false), td(fixed(a.median_m, 2)), td(fixed(a.p90_m, 2)), td(a.rollouts))))));
    byId("agreement-rows").append(agreementRows(agreement.rows));
    const times = (key) => [...agreement.disagreements.reduce((m, d) => m.set(d[key], (m.get(d[key]) || 0) + 1), new Map())].sort((a, b) => b[1] - a[1]);
    byId("agreement-cause").append(option("", "all"), ...times("cause").map(([cause, n]) => option(cause, `${cause.replace("_", " ")} (${n})`)));
    byId("agreement-program").append(option("", "all"), ...times("program").map(([program, n]) => option(program, `${program} (${n})`)));
    for (const id of ["agreement-cause", "agreement-program"]) byId(id).addEventListener("input", drawDisagreements);
    drawDisagreements();
  }

  // Opens the player at the contact, where the page holds the rollout; else it says the command that draws it.
  let openPlayer = () => {};
  function playButton(solution, scene) {
    const held = stage.rollouts.filter((p) => p.solution === solution && (!scene || p.scene === scene));
    const met = held.find((p) => p.contact) || held[0];
    if (met) return el("button", { class: "save", title: met.contact ? "plays it, at the contact" : "plays it", onclick: (e) => { e.stopPropagation(); openPlayer(solution, met.scene); } }, "play");
    return scene ? el("span", { class: "note", title: `evodrive scenes show --attempt ${solution} --scene ${scene} --html rollout.html` }, "…") : null;
  }

  // --- player: the recorded scene with the actors that the rollout changed put in their place
  function merged(rollout) {
    const base = EvoUnpack.drawing(stage.scenes[rollout.scene]), moved = rollout.changed.map(EvoUnpack.actor);
    const changed = new Map(moved.map((a) => [a.label, a]));
    const kept = base.actors.map((a) => { const now = changed.get(a.label); changed.delete(a.label); return now || a; });
    const adversaries = new Set(moved.filter((a) => a.role === "adversary").map((a) => a.label));
    const ghosts = base.actors.filter((a) => adversaries.has(a.label)).map((a) => ({ ...a, label: `${a.label} as logged`, role: "ghost" }));
    return { ...base, actors: [...ghosts, ...kept.filter((a) => a.role !== "ego"), ...changed.values(), ...kept.filter((a) => a.role === "ego")], contact: rollout.contact };
  }
  function drawPlayer() {
    byId("play-lacking").append(...(stage.unplayed || []).map((u) => el("li", {}, `${u.solution} in ${u.scene} cannot be played: ${u.reason}`)));
    const solutions = [...new Map(stage.rollouts.map((p) => [p.solution, p.role]))];
    if (!solutions.length) { byId("play-caption").textContent = data.live ? "Rollouts can be played here once the run is finished." : "No rollout was kept for playing."; return; }
    byId("play-solution").append(...solutions.map(([solution, role]) => el("option", { value: solution }, `${solution} – ${role}`)));
    if (stage.repetitions_left_out) byId("play-note").textContent = `Of lineages that differ only in their random seed, the first is played; ${stage.repetitions_left_out} others are not. \u201cevodrive scenes show\u201d draws any rollout.`;
    let player = null;
    let at = null;
    const play = () => {
      const chosen = stage.rollouts.find((p) => p.solution === byId("play-solution").value && p.scene === byId("play-scene").value);
      if (player) player.destroy();
      byId("play-stage").replaceChildren();
      byId("play-caption").textContent = chosen ? chosen.caption : "";
      if (chosen) player = EvoPlayer.mount(byId("play-stage"), merged(chosen), { height: Math.min(520, Math.max(300, innerHeight * 0.7)), ...(at === "contact" && chosen.contact ? { step: Math.max(0, chosen.contact.step) } : {}) });
    };
    const scenes = () => {
      const keep = byId("play-scene").value;
      const names = stage.rollouts.filter((p) => p.solution === byId("play-solution").value).map((p) => p.scene);
      byId("play-scene").replaceChildren(...names.map((n) => el("option", { value: n }, n)));
      if (names.includes(keep)) byId("play-scene").value = keep;
      play();
    };
    openPlayer = (solution, scene) => {
      at = "contact";
      byId("play-solution").value = solution; scenes();
      if (scene) { byId("play-scene").value = scene; play(); }
      at = null; byId("player").scrollIntoView();
    };
    byId("play-solution").addEventListener("change", scenes);
    byId("play-scene").addEventListener("change", play);
    scenes();
  }

  // --- a run that goes on: its page loads itself again, and is then as the reader left it
  const LEFT = `evodrive ${location.pathname}`;
  const fields = () => [...document.querySelectorAll("select[id], input[id]")];
  const stored = (action) => { try { return action(sessionStorage); } catch { return null; } };
  function follow() {
    const left = JSON.parse(stored((s) => s.getItem(LEFT)) || "null");
    if (left) {
      stored((s) => s.removeItem(LEFT));
      open = left.open;
      for (const field of fields()) {
        const value = left.fields[field.id];
        if (value === undefined) continue;
        if (field.type === "checkbox") field.checked = value; else if (field.tagName === "INPUT" || [...field.options].some((o) => o.value === value)) field.value = value; else continue;
        for (const name of ["input", "change"]) field.dispatchEvent(new Event(name));
      }
      sortedBy = left.sortedBy; page = left.page; drawAttempts();
      scrollTo(0, left.y);
    }
    if (!data.live) return;
    const { proposals, epochs, reload_s: seconds } = data.live, judged = data.attempts.length, settled = Math.min(epochs, ...data.lineages.map((l) => l.epochs.length));
    byId("live").hidden = false;
    byId("live-standing").textContent = `${judged} of ${proposals} proposals are finished, ${Math.min(100, Math.round(100 * judged / Math.max(1, proposals)))} %; ${settled} of ${epochs} epochs are finished. The page reloads every ${seconds} s; held-out scenes and the player come at the end.`;
    setInterval(() => {
      if (byId("live-hold").checked || document.hidden) return;
      const kept = Object.fromEntries(fields().map((f) => [f.id, f.type === "checkbox" ? f.checked : f.value]));
      stored((s) => s.setItem(LEFT, JSON.stringify({ fields: kept, open, sortedBy, page, y: scrollY })));
      location.reload();
    }, 1000 * seconds);
  }

  const option = (value, label) => el("option", { value }, label);
  byId("front-lineage").append(...data.lineages.map((l) => option(l.id, l.id)));
  byId("filter-lineage").append(option("", "all"), ...data.lineages.map((l) => option(l.id, l.id)));
  byId("filter-exit").append(option("", "all"), ...["declined", "invalid", "rejected", "evaluated"].map((e) => option(e, e)));
  // Many trees are drawn one at a time.
  byId("tree-lineage").append(...(data.lineages.length > TREES_AT_ONCE ? [] : [option("", "all")]), ...data.lineages.map((l) => option(l.id, l.id)));
  byId("tree-controls").hidden = data.lineages.length < 2;
  byId("tree-lineage").addEventListener("change", drawTree);
  for (const [id, step] of [["page-before", -1], ["page-next", 1]]) byId(id).addEventListener("click", () => { page += step; drawAttempts(); });
  byId("front-suite").append(...Object.entries(SUITES).map(([suite, words]) => option(suite, words)));
  addEventListener("resize", () => data.lineages.length && drawFront());
  for (const id of ["front-lineage", "front-suite"]) byId(id).addEventListener("change", drawFront);
  for (const id of ["filter-text", "filter-lineage", "filter-exit", "filter-accepted"]) byId(id).addEventListener("input", () => { page = 0; drawAttempts(); });
  // Of a large run the accepted ones are what a reader comes for.
  byId("filter-accepted").checked = data.attempts.some((a) => a.in_short);
  resultTable(); auditList(); costTable(); if (data.lineages.length) { drawFront(); drawTree(); } drawAttempts(); openCounsel(); openEvolution(); openAgreement(); drawPlayer(); follow();
  document.querySelectorAll("h2, th").forEach(explain);
  document.body.dataset.ready = "yes";
})().catch((error) => document.querySelector("header").append(String(error.message)));
