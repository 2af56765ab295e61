// --- rollouts: the recorded scene with the actors that the rollout changed put in their place
const rolloutOf = (solution, scene) => stage.rollouts.find((p) => p.solution === solution && (!scene || p.scene === scene));
const drawings = new Map();
function drawn(scene) {
  if (!drawings.has(scene)) drawings.set(scene, EvoUnpack.drawing(stage.scenes[scene]));
  return drawings.get(scene);
}
function merged(rollout) {
  const base = drawn(rollout.scene), moved = rollout.changed.map(EvoUnpack.actor);
  const changed = new Map(moved.map((a) => [a.label, a]));
  const kept = base.actors.map((a) => { const now = changed.get(a.label); changed.delete(a.label); return now || a; });
  const adversaries = new Set(moved.filter((a) => a.role === "adversary").map((a) => a.label));
  const ghosts = base.actors.filter((a) => adversaries.has(a.label)).map((a) => ({ ...a, label: `${a.label} as logged`, role: "ghost" }));
  return { ...base, actors: [...ghosts, ...kept.filter((a) => a.role !== "ego"), ...changed.values(), ...kept.filter((a) => a.role === "ego")], contact: rollout.contact };
}
const NEAR_M = 16; // so that a car is wider than its name is high
// The part of the world that tells a story: the way of ego and adversaries in the seconds around the contact, or all of it without one.
function around(drawings) {
  const met = drawings.map((d) => d.contact).filter(Boolean).pop(), points = [];
  for (const d of drawings) for (const a of d.actors) {
    if (a.role !== "ego" && a.role !== "adversary") continue;
    a.samples.forEach((s, k) => { if (s && (met ? k >= met.step - 20 && k <= met.step + 4 : k >= d.current_step)) points.push(s); });
  }
  if (!met) return points;
  const near = points.filter(([x, y]) => Math.hypot(x - met.point[0], y - met.point[1]) < NEAR_M);
  return near.length ? near : points;
}
// What a page shows of somebody whom it does not name: in which file and by which command it is drawn.
const showCommand = (solution, scene) => `evodrive scenes show --attempt ${solution} --scene ${scene} --html rollout.html`;
function playButton(solution, scene) {
  const held = stage.rollouts.filter((p) => p.solution === solution && (!scene || p.scene === scene));
  const met = held.find((p) => p.contact) || held[0];
  if (met) return el("button", { class: "save", title: met.contact ? "plays it, at the contact" : "plays it", onclick: (e) => { e.stopPropagation(); go({ tab: "scenes", scene: met.scene, a: solution, lineage: "" }); } }, "play");
  return scene ? el("span", { class: "note", title: showCommand(solution, scene) }, "…") : null;
}

// Several programs in one scene side by side, under one clock.
let films = [];
const stopFilms = () => { films.forEach((film) => film.stop()); films = []; };
function film(place, scene, sides, { height = 300, at = "before" } = {}) {
  const shown = sides.map(([name, solution]) => [name, rolloutOf(solution, scene)]).filter(([, rollout]) => rollout);
  if (!shown.length) { place.replaceChildren(note("No rollout of it was kept for playing.")); return; }
  const scenes = shown.map(([, rollout]) => merged(rollout)), frame = around(scenes), dt = scenes[0].dt_s, last = scenes[0].steps - 1;
  const met = scenes.map((d) => d.contact && d.contact.step).filter((step) => step !== null && step !== undefined);
  const end = met.length ? Math.min(last, Math.max(...met) + 8) : last, first = Math.max(0, Math.min(scenes[0].current_step, end - 10)), begin = met.length ? Math.max(first, Math.min(...met) - 40) : first;
  const panes = shown.map(([name, rollout]) => { const screen = el("div"); return { screen, node: el("div", { class: "pane" }, el("p", { class: "pane-head" }, el("b", {}, name), " ", el("code", {}, rollout.solution)), screen, el("p", { class: rollout.contact ? "pane-end met" : "pane-end" }, rollout.caption)) }; });
  const play = el("button", { class: "film-play" }, "▶ Play"), slider = el("input", { type: "range", min: first, max: end, step: 0.1, "aria-label": "Time" }), clock = el("span", { class: "film-clock", role: "status" });
  place.replaceChildren(el("div", { class: `panes of-${panes.length}` }, panes.map((p) => p.node)), el("div", { class: "film-bar" }, play, slider, clock));
  const players = panes.map((p, i) => EvoPlayer.mount(p.screen, scenes[i], { height, frame, bare: true }));
  // A rollout that is over stands still where it ended.
  const over = scenes.map((d) => { const ego = d.actors.find((a) => a.role === "ego"); return ego ? Math.max(0, ego.samples.reduce((end, s, k) => s ? k : end, 0)) : last; });
  let now = begin, frameId = 0, playing = false, stamp = null;
  const put = (to) => { now = Math.min(end, Math.max(first, to)); slider.value = now; clock.textContent = `${((now - scenes[0].start_step) * dt).toFixed(1)} s`; players.forEach((p, i) => p.seek(Math.min(now, over[i]))); };
  const stop = () => { playing = false; cancelAnimationFrame(frameId); play.textContent = "▶ Play"; };
  const tick = (t) => {
    if (!playing) return;
    if (stamp !== null) put(now + (t - stamp) / 1000 / dt * 0.7);
    stamp = t;
    if (now >= end) return stop();
    frameId = requestAnimationFrame(tick);
  };
  const start = () => { if (now >= end) put(begin); playing = true; stamp = null; play.textContent = "❚❚ Pause"; frameId = requestAnimationFrame(tick); };
  play.addEventListener("click", () => playing ? stop() : start());
  slider.addEventListener("input", () => { stop(); put(Number(slider.value)); });
  // The last one is what the others are compared with.
  const decisive = scenes.map((d) => d.contact && d.contact.step).filter((step) => step !== null && step !== undefined).pop();
  put(at === "contact" && decisive !== undefined ? decisive : begin);
  films.push({ stop() { stop(); players.forEach((p) => p.destroy()); }, toggle: () => play.click() });
}

// A still of a rollout near its contact, as a small picture.
const STILL = { traffic: "#8a949f", ego: "#0072d6", adversary: "#d9480f", interacting: "#d98200", cyclist: "#00805c", pedestrian: "#a8447f", static: "#8a7a66", ghost: "#9aa4b0" };
function still(rollout, width = 220, height = 150) {
  const scene = merged(rollout), met = scene.contact, points = around([scene]), step = met ? Math.min(met.step, scene.steps - 1) : Math.min(scene.steps - 1, scene.current_step + 30);
  const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]), middle = [(Math.min(...xs) + Math.max(...xs)) / 2, (Math.min(...ys) + Math.max(...ys)) / 2];
  const half = Math.max(14, (Math.max(...xs) - Math.min(...xs)) / 2 + 6, ((Math.max(...ys) - Math.min(...ys)) / 2 + 6) * width / height), scale = width / (2 * half);
  const at = ([x, y]) => [width / 2 + (x - middle[0]) * scale, height / 2 - (y - middle[1]) * scale], near = (p) => { const [x, y] = at(p); return x > -width && x < 2 * width && y > -height && y < 2 * height; };
  const path = (line) => line.map((p, i) => `${i ? "L" : "M"}${at(p).map((v) => v.toFixed(1)).join(" ")}`).join("");
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, class: "still", role: "img", "aria-label": rollout.caption });
  for (const [surfaces, kind] of [[scene.verges, "verge"], [scene.surfaces, "surface"]]) for (const surface of surfaces) if (surface.some(near)) root.append(svg("path", { class: kind, d: path(surface) + "Z" }));
  for (const line of scene.lines) if (line.points.some(near)) root.append(svg("path", { class: `road ${line.style}`, d: path(line.points) }));
  for (const a of scene.actors) {
    const lead = a.role === "ego" || a.role === "adversary", way = a.samples.slice(0, step + 1).filter(Boolean);
    if (lead && way.length > 1) root.append(svg("path", { d: path(way), fill: "none", stroke: STILL[a.role], "stroke-width": 1.6, "stroke-opacity": 0.7 }));
  }
  for (const a of scene.actors) {
    const s = a.samples[step];
    if (!s || !near(s) || a.role === "ghost") continue;
    const [x, y] = at(s), l = Math.max(a.length_m * scale, 6), w = Math.max(a.width_m * scale, 3.4);
    root.append(svg("rect", { x: -l / 2, y: -w / 2, width: l, height: w, rx: Math.min(2, w / 4), fill: STILL[a.role], stroke: "var(--panel)", "stroke-width": 0.8, transform: `translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${(-s[2] * 180 / Math.PI).toFixed(1)})` }));
  }
  if (met) { const [x, y] = at(met.point); root.append(svg("circle", { cx: x, cy: y, r: 9, fill: "none", stroke: "#d7191c", "stroke-width": 2.2 })); }
  return root;
}
