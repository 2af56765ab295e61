// --- scenes: stills of what the page can play, and the outcome of every held-out scene under parent and chosen program
// SafeBench's attack is a score of a whole set of runs: of a scene there is the contact.
const changes = () => data.safebench ? { "": "all scenes", won: "contact with the chosen alone", lost: "contact with the parent alone", both: "contact with both", none: "contact with neither" } : { "": "all scenes", won: "only the chosen attacks", lost: "only the parent attacks", both: "both attack", none: "nobody attacks" };
const changeOf = ([, p, c]) => !p || !c ? "none" : c[0] > 0 ? p[0] > 0 ? "both" : "won" : p[0] > 0 ? "lost" : "none";
const kindOf = (scene) => scene.split("/").slice(0, 2).join("/");
const PAIR_ORDERS = { "": "gained first", realism: "least realistic first", name: "by name", contact: "by class of contact" };
function drawScenes() {
  const ofProgram = state.a && data.lineages.find((l) => l.held_out.some((h) => h.measured.solution === state.a)), lineage = lineageOf(state.lineage) || ofProgram || bestLineage(), result = lineage.result, page = byId("scenes");
  if (!result) return page.replaceChildren(part("Scenes", note(data.live ? "Rollouts can be played here once the run is finished." : "No rollout was kept for playing.")));
  const evolved = result.evolved.solution, parent = result.parent.solution, a = rolloutOf(state.a) && lineage.held_out.some((h) => h.measured.solution === state.a) ? state.a : evolved, play = el("div", { id: "scene-film" });
  const playable = [...new Set(stage.rollouts.filter((p) => p.solution === a).map((p) => p.scene))];
  const pairs = lineage.pairs || [], byScene = new Map(pairs.map((p) => [data.scenes[p[0]], p])), rank = { won: 0, lost: 1, both: 2, none: 3 };
  const scene = playable.includes(state.scene) ? state.scene : playable.find((s) => { const p = byScene.get(s); return p && changeOf(p) === "won"; }) || playable[0];
  const names = [...new Set(stage.rollouts.filter((p) => lineage.held_out.some((h) => h.measured.solution === p.solution)).map((p) => p.solution))];
  const sides = a === parent || evolved === parent && a === evolved ? [["Parent", parent]] : [["Before: parent", parent], [a === evolved ? `After: ${shortId(a, lineage)}` : shortId(a, lineage), a]];
  const replay = rolloutOf(`replay, ${lineage.ego}`, scene);
  if (replay) sides.unshift(["No program", replay.solution]);
  const words = changes(), by = { won: `▲ ${words.won}`, lost: `× ${words.lost}`, both: `◆ ${words.both}`, none: `○ ${words.none}` };
  const order = (s, t) => rank[byScene.has(s) ? changeOf(byScene.get(s)) : "none"] - rank[byScene.has(t) ? changeOf(byScene.get(t)) : "none"];
  const grid = el("div", { class: "stills" }, [...playable].sort(order).map((s) => el("a", { class: s === scene ? "tile open" : "tile", href: address({ scene: s }), onclick: (e) => { if (!e.ctrlKey && !e.metaKey) { e.preventDefault(); go({ scene: s }); } } }, still(rolloutOf(a, s)), el("span", { class: "tile-name" }, s), el("span", { class: "note" }, byScene.has(s) ? by[changeOf(byScene.get(s))] : ""))));
  put(page, part("Scenes", lineageControls(lineage, names.length > 1 ? el("label", {}, "Program ", el("select", { id: "play-solution", onchange: (e) => go({ a: e.target.value }) }, names.map((n) => option(n, n === evolved ? `${n} – chosen` : n === parent ? `${n} – parent` : n, n === a)))) : null,
    playable.length ? el("label", {}, "Scene ", el("select", { id: "play-scene", onchange: (e) => go({ scene: e.target.value }) }, playable.map((s) => option(s, s, s === scene)))) : null),
    scene ? play : note("No rollout of it was kept for playing.", data.lineages.length > 1 && stage.repetitions_left_out ? ` Of lineages that differ only in their random seed, the one that gained most attack is played; ${stage.repetitions_left_out} others are not.` : "", " ", el("code", {}, `evodrive scenes show --attempt ${evolved}`), " draws any.")),
    playable.length ? el("section", { class: "part" }, el("h2", {}, `${counted(playable.length, "scene")}, each at its contact or its end`), grid) : null,
    pairsPart(lineage, pairs, playable), fullPlayer(a, scene),
    (stage.unplayed || []).length ? part("Cannot be played", list(stage.unplayed.map((u) => `${u.solution} in ${u.scene}: ${u.reason}`))) : null);
  if (scene) film(play, scene, sides, { height: sides.length > 2 ? 250 : 320, at: "contact" });
}
// The outcome of all held-out scenes.
function pairsPart(lineage, pairs, playable) {
  if (!pairs.length) return null;
  const counts = Object.keys(changes()).filter(Boolean).map((c) => [c, pairs.filter((p) => changeOf(p) === c).length]);
  const shown = pairs.filter((p) => !state.change || changeOf(p) === state.change), rank = { won: 0, lost: 1, both: 2, none: 3 }, name = (p) => data.scenes[p[0]];
  const realism = (p) => p[2] && p[2][1] !== null ? p[2][1] : 2, contact = (p) => p[2] && p[2][2] !== null ? data.classes[p[2][2]] : "~";
  shown.sort({ realism: (p, q) => realism(p) - realism(q), name: (p, q) => name(p) < name(q) ? -1 : 1, contact: (p, q) => contact(p) < contact(q) ? -1 : contact(p) > contact(q) ? 1 : 0 }[state.order] || ((p, q) => rank[changeOf(p)] - rank[changeOf(q)] || realism(q) - realism(p)));
  const side = (s) => !s ? "no label" : `${s[0] > 0 ? "attack" : s[2] !== null ? "contact that does not count" : "no contact"}${s[2] === null ? "" : `, ${plain(data.classes[s[2]])}${s[3] ? "" : " (bystander)"}`}${s[1] === null ? ", does not act" : `, R ${fixed(s[1], 3)}`}`;
  const signs = { won: ["triangle", "var(--accepted)"], lost: ["cross", "var(--invalid)"], both: ["diamond", "var(--evaluated)"], none: ["ring", "var(--declined)"] };
  const rows = virtual(shown, 48, (p) => el(playable.includes(name(p)) ? "a" : "div", { class: "row pair", role: "option", href: playable.includes(name(p)) ? address({ scene: name(p) }) : null, title: playable.includes(name(p)) ? "plays it" : showCommand(chosenOf(lineage), name(p)) }, small(...signs[changeOf(p)]), el("span", { class: "row-head" }, el("code", {}, name(p)), playable.includes(name(p)) ? " ▶" : ""), el("span", { class: "row-words" }, `parent: ${side(p[1])} · chosen: ${side(p[2])}`)), "Held-out scenes");
  rows.box.id = "pair-list";
  return el("section", { class: "part" }, el("h2", {}, `All ${pairs.length} held-out scenes`), el("p", {}, ...counts.map(([c, n]) => el("span", { class: "key" }, small(...signs[c]), `${changes()[c]} ${n}`))),
    el("div", { class: "controls" }, el("label", {}, "Show ", el("select", { id: "filter-change", onchange: (e) => go({ change: e.target.value }) }, Object.entries(changes()).map(([value, words]) => option(value, words, value === (state.change || ""))))), el("label", {}, "Order ", el("select", { id: "pair-order", onchange: (e) => go({ order: e.target.value }) }, Object.entries(PAIR_ORDERS).map(([value, words]) => option(value, words, value === (state.order || "")))))), rows.box);
}
// One rollout with all of the player's controls: zoom, names, ways, speed.
let player = null;
function fullPlayer(solution, scene) {
  const rollout = scene && rolloutOf(solution, scene);
  if (player) { player.destroy(); player = null; }
  if (!rollout) return null;
  const place = el("div", { id: "play-stage" });
  setTimeout(() => { if (place.isConnected) player = EvoPlayer.mount(place, merged(rollout), { height: Math.min(520, Math.max(300, innerHeight * 0.6)), step: rollout.contact ? rollout.contact.step : undefined, frame: rollout.contact ? around([merged(rollout)]) : undefined }); }, 0);
  return el("section", { class: "part", id: "player" }, el("h2", {}, "Scene player"), el("p", { id: "play-caption" }, `${solution} in ${scene}: ${rollout.caption}`), place);
}
