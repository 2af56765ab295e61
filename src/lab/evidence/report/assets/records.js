// --- world: counsel, the evaluator's own evolution, another simulator
function counselRound(round) {
  const distance = round.outcome === "contact" || round.distance_m === null ? "" : `, nearest ${fixed(round.distance_m, 1)} m`;
  return el("li", {}, el("code", {}, round.attackers.join(", ")), " ", el("b", { class: round.outcome === "contact" ? "pass" : "fail" }, plain(round.outcome)), distance, round.by === "rules" ? " (by the rules)" : "", el("br"), el("span", { class: "note" }, round.reason));
}
function counselPart() {
  if (!data.counsels.length) return null;
  const lineages = [...new Set(data.counsels.map((c) => c.lineage))], lineage = lineages.includes(state.counsel) ? state.counsel : lineages[0], table = el("div", { id: "counsel-table" });
  const all = data.counsels.filter((c) => c.lineage === lineage), met = (c) => c.rounds.some((r) => r.outcome === "contact");
  const says = (c) => [c.scene, ...c.rounds.flatMap((r) => [...r.attackers, r.outcome, plain(r.outcome), r.by])].join(" ").toLowerCase();
  const sets = (c) => ({ by: c.rounds.length ? c.rounds.length + (met(c) ? 0 : 1000) : null, node: c.rounds.length ? el("ol", {}, c.rounds.map(counselRound), c.refused.map(([round, why]) => el("li", {}, el("span", { class: "note" }, `round ${round}: answer not used: ${why}`)))) : el("span", {}, "no vehicle can attack") });
  const advised = (c) => ({ by: (c.advised || []).join(", "), node: el("code", {}, (c.advised || []).join(", ") || "nobody") });
  const draw = (text) => table.replaceChildren(sortable(["Scene", "Sets tried, and their outcome", "Advised"], all.filter((c) => !text || says(c).includes(text)).map((c) => [c.scene, sets(c), advised(c)]), `counsel-${lineage}`, { rowsAPage: 40, file: ["scene", "sets tried, 1000 more where none met the ego", "advised"] }));
  draw("");
  return el("section", { class: "part", id: "counsel" }, el("h2", {}, "Counsel"), el("div", { class: "controls" }, el("label", {}, "Search ", el("input", { id: "counsel-text", type: "search", placeholder: "scene, vehicle, outcome", oninput: (e) => draw(e.target.value.trim().toLowerCase()) })), el("label", {}, "Lineage ", el("select", { id: "counsel-lineage", onchange: (e) => go({ counsel: e.target.value }) }, lineages.map((id) => option(id, id, id === lineage))))),
    note(`The attacker agent named attackers for each scene before any program was tried in it; each set was tried with the parent program, without that program's own search. ${all.filter(met).length} of ${all.length} advised sets led to contact with the ego, ${all.filter((c) => c.rounds.length && c.rounds[0].outcome === "contact").length} of them at the first try.`), table);
}
// What the world agent proposed, and what the judge made of it.
function evolutionPart() {
  const turns = data.evolution;
  if (!turns) return null;
  const said = (changes) => Object.entries(changes).map(([key, value]) => `${key} = ${JSON.stringify(value)}`).join(", "), number = (value, digits) => value === null || value === undefined ? "–" : fixed(value, digits);
  const pair = (turn, name, digits) => turn.judgement ? `${number(turn.judgement.incumbent[name], digits)} → ${number(turn.judgement.challenger[name], digits)}` : "";
  const verdict = (turn) => ({ by: turn.verdict, node: el("b", { class: turn.verdict === "promoted" ? "pass" : "fail" }, `${turn.verdict === "promoted" ? "✓" : "✗"} ${turn.verdict}`) }), code = (text) => ({ by: text, node: el("code", {}, text) });
  return el("section", { class: "part", id: "evolution" }, el("h2", {}, "Evolution of the world evaluator"),
    note(`${turns.turns.length} turns: ${turns.promoted} promoted, ${turns.rejected} rejected, ${turns.refused} without a usable change; ${turns.refused_answers} answers were refused. Both configurations are measured on candidates of epochs that neither was fitted to; numbers are active → proposed.`),
    sortable(["After epoch", "Proposed change", "Verdict", "Rank correlation", "Error of R", "Coverage %", "False rejects %", "Why not"], turns.turns.map((turn) => [[turn.epoch, 0], code(said(turn.changes) || "none"), verdict(turn), pair(turn, "rank_correlation", 3), pair(turn, "realism_error", 3), pair(turn, "coverage_pct", 1), pair(turn, "false_reject_pct", 2), [...turn.refusals.map((why) => `refused: ${why}`), ...(turn.judgement ? turn.judgement.objections.map((o) => o.says) : [])].join("; ")]), "evaluator"),
    sortable(["From epoch", "Configuration", "Changes from the one before"], turns.active.map((row) => [[row.from_epoch, 0], row.configuration.slice(0, 12), said(row.changes) || "as the experiment says"]), "evaluator-active"));
}
function routerPart() {
  const routed = data.attempts.filter((a) => a.route && a.objectives);
  if (!routed.length) return null;
  const lineage = lineageOf(state.lineage), shown = routed.filter((a) => !lineage || a.lineage === lineage.id), place = el("div");
  const off = (key) => shown.reduce((sum, a) => sum + Math.abs(a.route.predicted[key] - a.objectives[key]), 0) / Math.max(1, shown.length);
  setTimeout(() => {
    const chart = axes(room(place, 520), 320, [0, 1], [0, 1], "predicted attack", "measured attack");
    chart.root.append(svg("line", { class: "rule", x1: chart.x(0), y1: chart.y(0), x2: chart.x(1), y2: chart.y(1) }));
    for (const a of shown) { const mark = signOf(a, chart.x(Math.min(1, Math.max(0, a.route.predicted.attack))), chart.y(a.objectives.attack), 4.5, { class: "pick", onclick: () => go({ tab: "attempts", attempt: a.id }) }); mark.append(svg("title", {}, `${a.id}: predicted ${fixed(a.route.predicted.attack, 3)}, measured ${fixed(a.objectives.attack, 3)}`)); chart.root.append(mark); }
    place.replaceChildren(chart.root);
  }, 0);
  return el("section", { class: "part" }, el("h2", {}, "Predictions of the world evaluator"), note(`${counted(shown.length, "attempt")} with a prediction and labels: attack is off by ${fixed(off("attack"), 3)} in the mean, ${STRICT()} by ${fixed(off("realism"), 4)}. On the line a prediction is right.`), el("figure", {}, place));
}
let agreementOpen = false;
function drawWorld() {
  const parts = [routerPart(), counselPart(), evolutionPart()].filter(Boolean);
  byId("world-parts").replaceChildren(...(parts.length || data.agreement ? parts : [part("World", note("This run has no predictions, no counsel and no other simulator to show."))]));
  if (!agreementOpen) { agreementOpen = true; openAgreement(); }
}

// --- cost
function drawCost() {
  const cost = data.cost;
  if (!cost) return byId("cost").replaceChildren(part("Cost", note("The run folder holds no cost.")));
  const wall = cost.lineages.reduce((sum, l) => sum + l.wall_s, 0), tokens = (n) => [n, 0, n ? n.toLocaleString("en") : "–"];
  const head = ["Lineage", "Wall s", "Share", "Rollouts", "Rollout s", "Compiled", "Compile s", "Answers", "Model s", "Tokens in", "Tokens out"];
  const line = (l) => [l.lineage, [l.wall_s, 1], [wall ? 100 * l.wall_s / wall : null, 0, wall ? `${fixed(100 * l.wall_s / wall, 0)} %` : "–"], [l.rollouts, 0], [l.rollout_s, 1], [l.compiled, 0], [l.compile_s, 1], [l.answers, 0], l.model_s ? [l.model_s, 1] : [null, 1, "–"], tokens(l.input_tokens), tokens(l.output_tokens)];
  const whole = Object.fromEntries(Object.entries(cost.lineages[0] || {}).map(([key, value]) => [key, typeof value === "number" ? cost.lineages.reduce((sum, l) => sum + (l[key] || 0), 0) : value]));
  const pinned = cost.lineages.length > 1 ? [line({ ...whole, lineage: "all lineages" })] : [];
  const table = el("div", { id: "cost-table" }, sortable(head, [...cost.lineages].sort((a, b) => b.wall_s - a.wall_s).map(line), "cost", { pinned }));
  byId("cost").replaceChildren(part("Cost", table, note(`${cost.simulated} rollouts simulated and ${cost.reused} read from the store in ${fixed(wall, 1)} s on ${cost.threads} threads. Times of rollouts, compiling and models are summed over threads; compiling includes a family's own search and the simulations in it. No result depends on these times.${cost.lineages.some((l) => l.answers && !l.model_s) ? " Where answers came from a recording or through files, nobody measured what the model took." : ""}`)));
}

// --- records: every number of the result, the audit, the provenance, the figures
function resultPart() {
  const rows = data.lineages.filter((l) => l.result);
  if (!rows.length) return part("Result", note("The run is not finished: no held-out result yet."));
  const strict = STRICT(), five = ["attack", "any crash", "realism", strict, "coverage"], groups = [["", 1], ["Change", 2], ["Evolved", 5], ["Parent", 5], ["Frontier", 1], ["", 1]];
  // What matters first: a narrow window shows the change.
  const head = ["Lineage", "attack", strict, ...five, ...five, "PF-Area@3 %", "Chosen program"];
  const acted = (l, m) => (heldOut(l, m.solution) || {}).realism_acted ?? null;
  const of = (l, m) => [[m.objectives.attack, 3], [m.any_contact, 3], [acted(l, m), 4], [m.coverage > 0 ? m.objectives.realism : null, 4], [m.coverage, 2]];
  // The recorded scenes without a program stand under the parent's heads, above the lineages however these are sorted.
  const none = Array.from({ length: 7 }, () => [null, 0]), nothing = (r) => [`no program, ${r.ego}`, ...none, [r.attack, 3], [r.contact_rate, 3], [r.realism, 4], [null, 0], [0, 2], [null, 0], ""];
  const chosen = (r, l) => ({ by: r.evolved.solution, node: el("span", { class: "chosen" }, el("code", {}, shortId(r.evolved.solution, l)), " ", playButton(r.evolved.solution)) }), change = (value, digits) => [value, digits, signed(value, digits)];
  const line = (l) => { const r = l.result; return [r.lineage, change(r.evolved.objectives.attack - r.parent.objectives.attack, 3), change(r.evolved.objectives.realism - r.parent.objectives.realism, 4), ...of(l, r.evolved), ...of(l, r.parent), change(r.pf_area_at_3_pct, 1), chosen(r, l)]; };
  const file = ["lineage", "change of attack", `change of ${strict}`, ...["evolved", "parent"].flatMap((which) => five.map((h) => `${which} ${h}`)), "PF-Area@3 %", "chosen program"];
  const compared = rows.filter((l) => l.compared).flatMap((l) => l.compared.quantities.map((q) => [l.id, q.quantity, estimate(q.difference, true), estimate(q.second), estimate(q.first), [q.scenes, 0]]));
  return el("section", { class: "part" }, el("h2", {}, "Result"), el("div", { id: "result-table" }, sortable(head, rows.map(line), "result", { groups, file, pinned: data.replay.filter((r) => r.suite === "held_out").map(nothing) })), ...data.unlabelled.map((told) => note(told)),
    note(`Held-out labels on ${rows[0].result.held_out_scenes} scenes, opened after the choice of programs. Attack is ${data.safebench ? "CR (1 − OS) over SafeBench's traffic families" : data.attack ? `the experiment's own measure, the mean over scenes of ${data.attack}` : "the share of scenes in which the ego fails by a contact that the experiment counts"}; any crash: the share of scenes in which the ego touches any road user. Realism is the mean over the scenes that a program acts in; ${data.safebench ? "ARS, SafeBench's adversarial realism score, is what the search uses" : "strict realism, which the search uses, is the smaller one of that and the mean over its successes"}; coverage is the share of scenes that it acts in. The first row is the recorded scenes without a program: the crashes of the ego in recorded traffic, and the realism of that traffic.`),
    compared.length ? [el("h3", {}, "Chosen program against parent, paired by scene"), el("div", { id: "compared-table" }, sortable(["Lineage", "Quantity", "Chosen − parent", "Chosen", "Parent", "Paired scenes"], compared, "compared", { rowsAPage: 24 })), note("On the held-out scenes; in brackets 95 % bootstrap intervals over scenes. Realism is the mean over the scenes in which the program acts; its difference is over the scenes in which both act.")] : null);
}
function drawRecords() {
  const breaches = data.findings.filter((f) => f.gravity === "breach").length, models = Object.entries(data.models);
  const marks = { holds: "✓", note: "!", against: "✗", unknown: "?" };
  put(byId("records"), resultPart(),
    el("section", { class: "part", id: "audit" }, el("h2", {}, "Audit"), note(!data.findings.length ? "No findings: the record is consistent and keeps the rules that every run must keep." : breaches ? `${breaches} breaches: the result cannot be trusted.` : "The record is sound. Notes for whoever uses the result:"), list(data.findings.map((f) => { const text = `${f.gravity} (${f.check}) ${f.place}: ${f.what}`; return text.length <= 400 ? text : el("details", {}, el("summary", {}, `${text.slice(0, 200)} …`), text); }))),
    part("What speaks for it", el("dl", { class: "badge-list" }, data.badges.flatMap((b) => [el("dt", { class: `is-${b.standing}` }, `${marks[b.standing]} ${b.says}`), el("dd", {}, b.rests_on)]))),
    part("Provenance", el("dl", {}, [[data.sealed ? "root" : "unfinished run, last event", data.root], ["experiment", data.experiment], ["scene pool", data.pool], ["versions", `adapter ${data.versions.adapter}, sim ${data.versions.sim}, eval ${data.versions.eval}`], ["scenes", `${data.evolution_scenes} evolution, ${data.held_out_scenes} held out`], ...models.map(([role, model]) => [plain(role), model])].flatMap(([name, value]) => [el("dt", {}, name), el("dd", { class: "mono" }, String(value))]))),
    figures.length ? part("Figures", note("In a figure of attempts each has the sign of the farthest step that it came to: one that was accepted is not among the evaluated ones, nor a promoted one among the accepted."), ...figures.map(({ title, svg: text }) => {
      const name = title.replace(/[^A-Za-z0-9_.-]+/g, "_");
      return el("figure", { class: "of-print" }, el("img", { src: `data:image/svg+xml,${encodeURIComponent(text)}`, alt: title, class: "sheet", loading: "lazy" }), el("figcaption", {}, `${title} `, el("button", { class: "save", onclick: () => save(`${name}.svg`, "image/svg+xml", text) }, "SVG")));
    })) : null);
}
