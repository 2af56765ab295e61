// --- the first screen: what evolved, by how much, by what, and why it can be believed
const lead = (text, most) => { if (text.length <= most) return text; const cut = text.slice(0, most), stop = Math.max(cut.lastIndexOf(". "), cut.lastIndexOf("; ")); return stop > most / 2 ? cut.slice(0, stop + 1) : `${cut.slice(0, cut.lastIndexOf(" "))} …`; };
const CLASS_WORDS = { ego_strikes: "the ego runs into the other", ego_sideswipes: "the ego sideswipes the other", stationary_hit: "the ego runs into something that stands", cut_in: "the other cuts in", crossing: "crossing", head_on: "head on", sideswipe: "the other sideswipes the ego", rear_end_ego_struck: "the ego is rammed from behind" };
const contactsInWords = ({ contacts, preventable: [preventable, assessed] }) => { const all = contacts.reduce((sum, [, n]) => sum + n, 0); return contacts.slice(0, 2).map(([name, n]) => `${CLASS_WORDS[name] || plain(name)} ${fixed(100 * n / all, 0)} %`).join(", ") + (assessed ? `; of ${assessed} assessed ones ${fixed(100 * preventable / assessed, 0)} % are preventable` : ""); };

function drawAnswer() {
  const best = bestLineage(), headline = best && headlineOf(best), page = byId("answer-more"), result = best && best.result;
  byId("answer").querySelectorAll("li[data-lineage]").forEach((row) => { row.onclick = () => go({ tab: "mechanism", lineage: row.dataset.lineage }); row.title = "shows what it does"; });
  if (!best) return page.replaceChildren(note("No lineage has begun."));
  const chart = el("div"), play = el("div", { id: "answer-film" });
  const sections = [];
  if (result) {
    const evolved = result.evolved.solution, stays = evolved === result.parent.solution, program = shortId(evolved, best);
    sections.push(el("section", { class: "part" }, el("h2", {}, stays ? `${best.id}: the parent stays` : `What ${best.group || best.id} does now`), ...mechanismGist(best)));
    const scenes = [...new Set(stage.rollouts.filter((p) => p.solution === evolved).map((p) => p.scene))];
    const both = scenes.filter((scene) => rolloutOf(result.parent.solution, scene));
    const won = both.find((s) => rolloutOf(evolved, s).contact && !rolloutOf(result.parent.solution, s).contact);
    const scene = won || scenes.find((s) => rolloutOf(evolved, s).contact) || both[0] || scenes[0];
    const because = won ? "chosen because it tells most of what changed" : stays ? "nothing changed, for the parent stays" : "in none that is played here does the program meet the ego where its parent does not";
    if (scene) {
      sections.unshift(el("section", { class: "part" }, el("h2", {}, stays ? "What the parent does" : "Before and after, in one scene"), play, filmKey(scene, [result.parent.solution, evolved]), note(otherActors(scene, result.parent.solution, evolved), `Held-out scene ${scene}: ${because}${both.length > 1 ? "; " : ". "}`, both.length > 1 ? link({ tab: "scenes", lineage: best.id }, `${counted(both.length, "scene")} of every outcome to play, and how all ended`) : null, both.length > 1 ? ". " : null, `Other drivers and seeds may give other outcomes.`)));
      setTimeout(() => { if (play.isConnected) film(play, scene, stays ? [["Parent", evolved]] : [["Before: parent", result.parent.solution], [`After: ${program}`, evolved]], { height: matchMedia("(max-width: 700px)").matches ? 210 : 270, at: "contact" }); }, 0);
    }
  }
  const exits = ["declined", "invalid", "rejected", "evaluated"], n = (exit) => data.attempts.filter((a) => a.exit === exit).length;
  const counts = el("p", { id: "counts", class: "note" }, `${counted(data.attempts.length, "attempt")}: `, exits.map((exit) => `${n(exit)} ${exit}`).join(", "), `; of the evaluated ones ${data.attempts.filter(accepted).length} were accepted, and of these ${data.attempts.filter((a) => a.decision && a.decision.promoted).length} promoted; ${data.rollouts ?? "–"} rollouts. `, link({ tab: "attempts" }, "All attempts"), " · ", link({ tab: "records" }, "all numbers"), ".");
  put(page, el("div", { class: sections.length ? "answer-grid" : null }, sections.length ? el("div", {}, ...sections.slice(0, 1)) : null, el("section", { class: "part" }, el("h2", {}, result ? `Held-out front of ${best.id}` : `The front of ${best.id} so far`), el("figure", { id: "answer-front" }, chart))), ...sections.slice(1), creditPart(best), othersPart(), counts);
  fitting(() => plane(chart, best, data.sealed ? "held_out" : "search", { most: 620, height: 340 }));
}
// That the two programs drive different road users, where they do.
function otherActors(scene, parent, evolved) {
  const [was, is] = [parent, evolved].map((solution) => { const rollout = rolloutOf(solution, scene); return rollout ? merged(rollout).actors.filter((a) => a.role === "adversary").map((a) => a.label).join(", ") : ""; });
  return was && is && was !== is ? `The parent drives ${was}, this program ${is}. ` : "";
}
// What the colours of the films are, of the roles that occur in them.
const ROLE_WORDS = { ego: "driver under test", adversary: "road user whom the program drives", ghost: "as it was recorded", interacting: "marked as interacting in the data", traffic: "other traffic" };
function filmKey(scene, solutions) {
  const rollouts = solutions.map((solution) => rolloutOf(solution, scene)).filter(Boolean), roles = new Set(rollouts.flatMap((r) => merged(r).actors.map((a) => a.role)));
  return el("p", { class: "note film-key" }, Object.entries(ROLE_WORDS).filter(([role]) => roles.has(role)).map(([role, words]) => el("span", { class: "key" }, el("i", { class: `swatch ${role}` }), words)), rollouts.some((r) => r.contact) ? el("span", { class: "key" }, el("b", { class: "ring", "aria-hidden": "true" }, "⊕"), " contact") : null);
}
// The phrase of the program's structure, the proposer's own words, the first changes, the diff below.
function mechanismGist(lineage) {
  const m = lineage.mechanism, headline = headlineOf(lineage) || { contacts: [] };
  if (!lineage.result) return [note("The run is not finished: what its program does stands here at the end. ", link({ tab: "attempts" }, "Attempts so far"))];
  if (!m) return [note("No descendant was better by the rule of the experiment, so the program that was published is what the run reports. ", link({ tab: "front", lineage: lineage.id }, "Why"))];
  const words = m.steps.map(attemptOf).filter((a) => a && a.hypothesis);
  return [lineage.gains_by ? el("p", { class: "gist" }, `${lineage.gains_by}.`) : null,
    m.says ? el("p", {}, `What is new in it: ${m.says}.`) : null,
    m.modules.length ? el("dl", { class: "named" }, m.modules.slice(0, 6).flatMap((module) => [el("dt", {}, `“${plain(module.name)}”`), el("dd", {}, el("small", {}, module.what), module.outline.slice(0, 8).map(([depth, line]) => el("div", { style: `margin-left: ${14 * depth}px` }, line)), module.outline.length > 8 ? el("div", {}, "…") : null)])) : null,
    headline.lineage === lineage.id && headline.contacts.length ? el("p", {}, "Its contacts that count: ", contactsInWords(headline), ".") : null,
    words.length ? el("p", { class: "note" }, words.length > 1 ? `What its proposer expected of each of its ${words.length} patches:` : "What its proposer expected:") : null,
    ...words.map((a) => el("blockquote", {}, lead(a.hypothesis, 420), " ", el("cite", {}, "– ", link({ tab: "attempts", attempt: a.id }, shortId(a.id, lineage))))),
    el("details", { class: "diff-box" }, el("summary", {}, `The change as a diff (${m.diff.split("\n").filter((l) => /^[+-](?![+-])/.test(l)).length} lines)`), diffText(m.diff)),
    el("p", {}, link({ tab: "mechanism", lineage: lineage.id }, "What it does step by step, every expression and change"))];
}
const diffText = (text) => el("pre", { class: "diff", tabindex: 0 }, text.split("\n").map((line) => el("span", { class: line.startsWith("+") ? "add" : line.startsWith("-") ? "del" : line.startsWith("@@") ? "hunk" : null }, line + "\n")));

// What `credit` says in words, and its numbers. A patch that cannot be taken out alone has none.
function creditPart(lineage) {
  const credit = lineage.credit;
  if (!credit) return !lineage.mechanism ? null : el("section", { class: "part", id: "credit" }, el("h2", {}, "Credit of each patch"), note("Not worked out yet: ", el("code", {}, "evodrive report --credit"), " plays the chosen program without each of its patches, and adds it here."));
  // The interval stands below the value, so that all columns fit a page.
  const stacked = (e) => !e ? "–" : { by: estimate(e, true), node: el("span", { class: "stacked" }, signed(e.value, 3), e.interval ? el("small", {}, `[${e.interval.map((x) => signed(x, 3)).join(", ")}]`) : null) };
  const cells = (gain) => [stacked(gain && gain.attack), stacked(gain && gain.realism)];
  const rows = credit.edits.map((e) => [{ by: e.name, node: link({ tab: "attempts", attempt: e.name }, shortId(e.name, lineage)) }, ...cells(e.so_far), ...cells(e.needed), ...cells(e.alone)]);
  return el("section", { class: "part", id: "credit" }, el("h2", {}, "Credit of each patch"), credit.edits.length > 1 && credit.edits.every((e) => e.so_far) ? el("p", {}, "Patch by patch the chain came to attack ", credit.edits.map((e) => signed(e.so_far.attack.value, 3)).join(" → "), ". What each patch is worth at the end:") : null, list(credit.edits.map((e) => e.says)),
    sortable(["Patch", "attack", "realism", "attack", "realism", "attack", "realism"], [["all together", ...cells(credit.whole), ...cells(credit.whole), "–", "–"], ...rows], `credit-${lineage.id}`, { groups: [["", 1], ["With the patches so far", 2], ["Lost without it", 2], ["Alone on the parent", 2]], file: ["patch", ...["so far", "lost without it", "alone"].flatMap((of) => [`${of}: attack`, `${of}: realism`])] }),
    note("On the held-out scenes, paired by scene; in brackets 95 % bootstrap intervals over scenes. So far: the parent with the patches up to this one minus the parent. Lost without it: the chosen program minus the program without this patch. Alone: the parent with this patch minus the parent. Shares need not add up to the whole, because patches may need each other or do the same."));
}

// What runs beside this one came to, search by search: this run is the first of both, so a positive difference is the other one's.
function othersPart() {
  if (!data.others) return null;
  const of = (row, name) => row.quantities.find((q) => q.quantity === name) || {};
  const table = (o) => sortable(["Lineage", "attack here", "there", "difference", "realism", STRICT(), "any crash", "scenes"], o.rows.map((r) => [r.seeds > 1 ? `${r.search} (${r.seeds} searches)` : r.search, estimate(of(r, "attack").first), estimate(of(r, "attack").second), estimate(of(r, "attack").difference, true), estimate(of(r, "realism").difference, true), estimate(of(r, STRICT()).difference, true), estimate(of(r, "any crash").difference, true), [r.scenes, 0]]), `beside-${o.name}`, { groups: [["", 1], ["Attack", 3], ["Difference of", 3], ["", 1]] });
  return el("section", { class: "part", id: "beside" }, el("h2", {}, data.others.length > 1 ? "Beside other runs" : "Beside another run"), ...data.others.flatMap((o) => [el("h3", {}, `${capital(o.by)}: ${o.name} `, el("small", {}, `root ${o.root.slice(0, 12)}`)), table(o), o.notes.length ? list(o.notes) : null]),
    note("Differences are the other run minus this one, paired by scene; in brackets 95 % bootstrap intervals, over searches and scenes where several searches are compared, else over scenes."));
}

// --- the mechanism: every change, the expressions, the diff; and any two programs beside each other
function drawMechanism() {
  const lineage = lineageOf(state.lineage) || bestLineage(), m = lineage.mechanism;
  const expression = (module) => el("div", { class: "module" }, el("h3", {}, `${plain(module.name)} `, el("small", {}, module.what)),
    el("pre", { class: "outline", tabindex: 0 }, module.outline.map(([depth, line]) => `${"   ".repeat(depth)}${line}\n`)),
    module.names.length ? el("details", {}, el("summary", {}, "What its words mean"), el("dl", {}, module.names.flatMap((name) => [el("dt", {}, plain(name)), el("dd", {}, data.meanings[name])]))) : null);
  put(byId("mechanism"), part(`What ${chosenOf(lineage)} does otherwise than its parent`, lineageControls(lineage), ...mechanismGist(lineage).filter((n) => !n || n.tagName !== "P" || !n.querySelector("a[href*='tab=mechanism']"))),
    m && m.flow && m.flow.length ? part("What it does with a scene, step by step", el("ol", { class: "flow" }, m.flow.map((step) => el("li", { class: step.is_new ? "new" : null, style: `margin-left: ${22 * step.depth}px` }, step.is_new ? el("b", {}, "new ") : null, step.says))), note("Steps without a mark are the parent's. Names in quotes are expressions, which stand below.")) : null,
    m && m.modules.length ? part("Its expressions, in words", el("div", { class: "modules" }, m.modules.map(expression))) : null,
    m && m.changes && m.changes.length ? el("section", { class: "part" }, el("details", { class: "diff-box" }, el("summary", {}, `Every change, part by part (${m.changes.length})`), list(m.changes))) : null,
    creditPart(lineage), comparePart(lineage));
}
function comparePart(lineage) {
  const names = Object.keys(data.programs);
  if (names.length < 2) return null;
  const a = names.includes(state.a) ? state.a : (lineage.result || {}).parent && names.includes(lineage.result.parent.solution) ? lineage.result.parent.solution : names[0];
  const b = names.includes(state.b) ? state.b : lineage.result && lineage.result.evolved.solution !== a && names.includes(lineage.result.evolved.solution) ? lineage.result.evolved.solution : names.find((n) => n !== a);
  const choose = (key, value) => el("select", { id: `compare-${key}`, onchange: (e) => go({ [key]: e.target.value }) }, names.map((n) => option(n, n, n === value)));
  const of = (name) => { for (const l of data.lineages) { const h = heldOut(l, name); if (h) return h; } return null; };
  const [first, second] = [of(a), of(b)], rows = [["attack", (h) => h.measured.objectives.attack, 3], [STRICT(), (h) => h.measured.objectives.realism, 4], ["realism", (h) => h.realism_acted, 4], ["fails", (h) => h.failing_share ?? null, 3], ["coverage", (h) => h.measured.coverage, 2], ["any crash", (h) => h.measured.any_contact, 3]];
  const play = el("div"), scene = stage.rollouts.filter((p) => p.solution === a).map((p) => p.scene).filter((s) => rolloutOf(b, s));
  const at = scene.includes(state.scene) ? state.scene : scene.find((s) => !!rolloutOf(a, s).contact !== !!rolloutOf(b, s).contact) || scene[0];
  if (at) setTimeout(() => { if (play.isConnected) film(play, at, [["A", a], ["B", b]], { height: 260, at: "contact" }); }, 0);
  return el("section", { class: "part", id: "compare" }, el("h2", {}, "Two programs beside each other"), el("div", { class: "controls" }, el("label", {}, "A ", choose("a", a)), el("label", {}, "B ", choose("b", b)),
    scene.length ? el("label", {}, "Scene ", el("select", { id: "compare-scene", onchange: (e) => go({ scene: e.target.value }) }, scene.map((s) => option(s, s, s === at)))) : null),
    first && second ? sortable(["On held-out scenes", "A", "B", "B − A"], rows.filter(([, value]) => value(first) !== null).map(([name, value, digits]) => [name, [value(first), digits], [value(second), digits], [value(second) - value(first), digits, signed(value(second) - value(first), digits)]]), `compare-${a}-${b}`) : null,
    at ? play : note("No scene is played with both; ", el("code", {}, `evodrive scenes show --attempt ${b}`), " draws any."),
    el("h3", {}, "From A to B"), diffText(lineDiff(data.programs[a], data.programs[b])));
}
// The lines that differ, with two around each, by the longest common part.
function lineDiff(one, other) {
  const a = one.split("\n"), b = other.split("\n"), n = a.length, m = b.length, best = Array.from({ length: n + 1 }, () => new Uint16Array(m + 1));
  for (let i = n - 1; i >= 0; i--) for (let j = m - 1; j >= 0; j--) best[i][j] = a[i] === b[j] ? best[i + 1][j + 1] + 1 : Math.max(best[i + 1][j], best[i][j + 1]);
  const lines = [];
  for (let i = 0, j = 0; i < n || j < m;) {
    if (i < n && j < m && a[i] === b[j]) { lines.push(` ${a[i]}`); i++; j++; } else if (i < n && (j >= m || best[i + 1][j] >= best[i][j + 1])) lines.push(`-${a[i++]}`); else lines.push(`+${b[j++]}`);
  }
  const near = lines.map((_, k) => lines.slice(Math.max(0, k - 2), k + 3).some((l) => l[0] !== " "));
  const kept = lines.flatMap((l, k) => near[k] ? (k && !near[k - 1] ? ["@@", l] : [l]) : []);
  return kept.length ? kept.join("\n") : "Both are the same program.";
}
