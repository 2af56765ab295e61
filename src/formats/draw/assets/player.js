// Plays a drawing on a canvas. Needs nothing but the page it stands in.
// EvoPlayer.mount(element, drawing, { autoplay, follow, fill, height, step, frame, bare }) -> { seek, play, pause, destroy }
// `frame`: places that are in sight at first; `bare`: the picture alone, for a page that has controls of its own.
const EvoPlayer = (() => {
  "use strict";

  const ROLES = {
    ego: "ego", adversary: "adversary", interacting: "interacting", traffic: "traffic",
    cyclist: "cyclist", pedestrian: "pedestrian", static: "static", ghost: "logged",
  };
  const LEADING = new Set(["ego", "adversary", "interacting"]);
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
  const LIGHTS = { go: "#1a9850", caution: "#e6a700", stop: "#d73027", unknown: "#888888" };
  const ORDER = Object.keys(ROLES).reverse();

  function element(tag, properties, children) {
    const node = document.createElement(tag);
    for (const [key, value] of Object.entries(properties || {})) {
      if (key in node) node[key] = value; else node.setAttribute(key, value);
    }
    for (const child of children || []) node.append(child);
    return node;
  }

  const turn = (a, b) => { // from a to b by the shorter way
    let d = (b - a) % (2 * Math.PI);
    if (d > Math.PI) d -= 2 * Math.PI;
    if (d < -Math.PI) d += 2 * Math.PI;
    return d;
  };

  // The pose between two samples; null where the actor is absent.
  function pose(actor, time) {
    const k = Math.floor(time), a = actor.samples[k];
    if (!a) return null;
    const b = actor.samples[k + 1], t = time - k;
    if (!b || t === 0) return a;
    return [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + turn(a[2], b[2]) * t, a[3] + (b[3] - a[3]) * t];
  }

  function bounds(points) {
    let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
    for (const [x, y] of points) {
      x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y);
    }
    return x0 <= x1 ? [x0, y0, x1, y1] : [-50, -50, 50, 50];
  }

  function pathOf(points, closed) {
    const path = new Path2D();
    points.forEach(([x, y], k) => (k ? path.lineTo(x, y) : path.moveTo(x, y)));
    if (closed) path.closePath();
    return path;
  }

  // Stripes across a crosswalk of four corners; any other shape is filled whole.
  function stripes(corners) {
    const path = new Path2D();
    if (corners.length !== 4) { path.addPath(pathOf(corners, true)); return path; }
    const gap = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]);
    let [a, b, c, d] = corners;
    [a, b, c, d] = gap(a, b) < gap(b, c) ? [a, b, d, c] : [b, c, a, d];
    const count = Math.max(1, Math.min(200, Math.floor((gap(a, c) + gap(b, d)) / 2)));
    const mix = (p, q, t) => [p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t];
    for (let k = 0; k < count; k++) {
      const [f, t] = [(k + 0.25) / count, (k + 0.75) / count];
      path.addPath(pathOf([mix(a, c, f), mix(b, d, f), mix(b, d, t), mix(a, c, t)], true));
    }
    return path;
  }

  function mount(root, drawing, options = {}) {
    const last = Math.max(0, drawing.steps - 1);
    // From the first simulated step, as in captions and results.
    const seconds = (step) => (step - (drawing.start_step || 0)) * drawing.dt_s + 0;
    const actors = [...drawing.actors].sort((a, b) => ORDER.indexOf(a.role) - ORDER.indexOf(b.role));
    const ego = drawing.actors.find((a) => a.role === "ego");
    const state = {
      time: Math.min(last, options.step ?? drawing.current_step), playing: false, speed: 1,
      follow: Boolean(options.follow), trails: true, labels: false, x: 0, y: 0, scale: 5, fitted: false,
      clock: null, hover: null,
    };

    // What is fixed is cut once.
    const road = {
      verges: drawing.verges.map((p) => pathOf(p, true)),
      surfaces: drawing.surfaces.map((p) => pathOf(p, true)),
      crosswalks: drawing.crosswalks.map(stripes),
      lines: drawing.lines.map((l) => ({ style: l.style, path: pathOf(l.points, false) })),
    };

    root.classList.add("evo-player");
    root.classList.toggle("evo-bare", Boolean(options.bare));
    const canvas = element("canvas", { tabIndex: 0, role: "img" });
    canvas.setAttribute("aria-label", "Top view of the scene; space plays, arrow keys step, F follows the ego, R shows all");
    const legend = element("ul", { className: "evo-legend" });
    const readout = element("div", { className: "evo-readout" });
    const tip = element("div", { className: "evo-tip", hidden: true });
    const stage = element("div", { className: "evo-stage" }, [canvas, legend, readout, tip]);
    if (!options.fill) stage.style.height = (options.height || 440) + "px";
    const play = element("button", { className: "evo-play", type: "button" });
    const slider = element("input", { type: "range", min: 0, max: last, step: 1 });
    slider.setAttribute("aria-label", "Time");
    const time = element("span", { className: "evo-time" }, [slider]);
    if (drawing.contact) {
      const share = Math.min(1, drawing.contact.step / Math.max(1, last));
      const mark = element("button", { className: "evo-mark", type: "button", title: `To the contact, ${seconds(drawing.contact.step).toFixed(1)} s` });
      mark.setAttribute("aria-label", mark.title);
      // The thumb is 16 px wide, and its middle goes from 8 px behind the left end to 8 px before the right.
      mark.style.left = `calc(8px + ${share} * (100% - 16px))`;
      mark.addEventListener("click", () => { pause(); seek(drawing.contact.step); });
      time.append(mark);
    }
    const clock = element("span", { className: "evo-clock" });
    const speed = element("select", { title: "Speed (keys [ and ])" },
      SPEEDS.map((s) => element("option", { value: s, textContent: s + "×" })));
    speed.setAttribute("aria-label", "Playing speed");
    speed.value = 1;
    const toggle = (text, key, title, optional) => {
      const button = element("button", { type: "button", textContent: text, title, className: optional ? "evo-optional" : "" });
      button.addEventListener("click", () => { state[key] = !state[key]; refresh(); });
      return button;
    };
    const follow = toggle("Follow ego", "follow", "Follow the ego (F)");
    follow.hidden = !ego;
    const trails = toggle("Trails", "trails", "Show ways (T)", true);
    const labels = toggle("Labels", "labels", "Show names (L)", true);
    const fit = element("button", { type: "button", textContent: "Show all", title: "Show everything (R)" });
    const theme = element("button", { type: "button", textContent: "◐", title: "Light or dark (D)" });
    theme.setAttribute("aria-label", "Switch between light and dark");
    const bar = element("div", { className: "evo-bar" }, [play, time, clock, speed, follow, trails, labels, fit, theme]);
    root.append(stage, bar);

    for (const role of Object.keys(ROLES)) {
      const count = drawing.actors.filter((a) => a.role === role).length;
      if (!count) continue;
      const swatch = element("i");
      swatch.style.background = `var(--${role})`;
      legend.append(element("li", {}, [swatch, ROLES[role] + (count > 1 ? ` (${count})` : "")]));
    }

    const context = canvas.getContext("2d");
    let ratio = 1, width = 0, height = 0, colours = {}, frame = 0;

    const COLOURS = ["ground", "verge", "surface", "edge", "divider", "opposite", "crosswalk", "text", "outline", "contact", ...Object.keys(ROLES)];
    function readColours() {
      const style = getComputedStyle(root);
      for (const name of COLOURS) colours[name] = style.getPropertyValue("--" + name).trim();
    }

    function isDark() {
      return root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    }

    function showAll(everything) {
      const points = [];
      for (const actor of drawing.actors) {
        if (everything || LEADING.has(actor.role)) for (const s of actor.samples) if (s) points.push(s);
      }
      if (everything) for (const surface of [...drawing.verges, ...drawing.surfaces]) points.push(...surface);
      const framed = !everything && options.frame && options.frame.length > 0;
      const [x0, y0, x1, y1] = bounds(framed ? options.frame : points);
      const margin = everything ? 5 : framed ? 7 : 28;
      state.x = (x0 + x1) / 2; state.y = (y0 + y1) / 2;
      state.scale = Math.min(width / (x1 - x0 + 2 * margin), height / (y1 - y0 + 2 * margin));
    }

    function resize() {
      const box = stage.getBoundingClientRect();
      if (box.width < 2 || box.height < 2) return;
      [width, height, ratio] = [box.width, box.height, window.devicePixelRatio || 1];
      canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
      if (!state.fitted) { showAll(false); state.fitted = true; }
      draw();
    }

    const toScreen = (x, y) => [width / 2 + (x - state.x) * state.scale, height / 2 - (y - state.y) * state.scale];
    const toWorld = (px, py) => [state.x + (px - width / 2) / state.scale, state.y - (py - height / 2) / state.scale];

    function draw() {
      const c = context;
      if (state.follow && ego) {
        const at = pose(ego, state.time);
        if (at) [state.x, state.y] = at;
      }
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.fillStyle = colours.ground; c.fillRect(0, 0, width, height);
      c.save();
      c.translate(width / 2, height / 2); c.scale(state.scale, -state.scale); c.translate(-state.x, -state.y);
      const px = 1 / state.scale;
      drawRoad(c, px);
      if (state.trails) for (const actor of actors) drawTrail(c, actor, px);
      for (const actor of actors) drawActor(c, actor, px);
      c.restore();
      drawContact(c);
      drawNames(c);
      drawScale(c);
      updateReadout();
    }

    function drawRoad(c, px) {
      c.lineJoin = "round";
      c.lineWidth = Math.max(0.3, px);
      for (const [paths, colour] of [[road.verges, colours.verge], [road.surfaces, colours.surface]]) {
        c.fillStyle = c.strokeStyle = colour;
        for (const path of paths) { c.fill(path); c.stroke(path); }
      }
      c.fillStyle = colours.crosswalk; c.globalAlpha = 0.85;
      for (const path of road.crosswalks) c.fill(path);
      c.globalAlpha = 1;
      for (const line of road.lines) {
        c.strokeStyle = colours[line.style];
        c.lineWidth = Math.max(line.style === "edge" ? 0.22 : 0.14, px);
        c.setLineDash(line.style === "divider" ? [3, 4.5] : []);
        c.stroke(line.path);
      }
      c.setLineDash([]);
      for (const [x, y] of drawing.stop_signs) {
        const r = Math.max(0.9, 4 * px);
        c.beginPath();
        for (let k = 0; k < 8; k++) {
          const a = (k + 0.5) * Math.PI / 4;
          c.lineTo(x + r * Math.cos(a), y + r * Math.sin(a));
        }
        c.closePath(); c.fillStyle = "#b3261e"; c.strokeStyle = "#ffffff"; c.lineWidth = px; c.fill(); c.stroke();
      }
      for (const light of drawing.lights) {
        c.beginPath(); c.arc(light.point[0], light.point[1], Math.max(0.85, 4 * px), 0, 7);
        c.fillStyle = LIGHTS[light.states[Math.round(state.time)]] || LIGHTS.unknown;
        c.strokeStyle = "#111111"; c.lineWidth = px; c.fill(); c.stroke();
      }
    }

    function drawTrail(c, actor, px) {
      const lead = LEADING.has(actor.role), now = Math.floor(state.time);
      c.strokeStyle = colours[actor.role]; c.lineCap = "round"; c.lineJoin = "round";
      c.lineWidth = Math.max(lead ? 0.4 : 0.22, (lead ? 2 : 1) * px);
      const stretch = (from, to) => {
        c.beginPath();
        let pen = false;
        for (let k = from; k <= to; k++) {
          const s = actor.samples[k];
          if (!s) { pen = false; continue; }
          if (pen) c.lineTo(s[0], s[1]); else c.moveTo(s[0], s[1]);
          pen = true;
        }
        c.stroke();
      };
      c.globalAlpha = lead ? 0.85 : 0.35;
      stretch(lead ? 0 : Math.max(0, now - 20), now);
      if (lead) {
        c.globalAlpha = 0.55;
        c.setLineDash([0.01, Math.max(0.9, 4.5 * px)]);
        stretch(now, last);
        c.setLineDash([]);
      }
      c.globalAlpha = 1; c.lineCap = "butt";
    }

    function drawActor(c, actor, px) {
      const at = pose(actor, state.time);
      if (!at) return;
      const lead = LEADING.has(actor.role), [l, w] = [actor.length_m, actor.width_m];
      // Small ones stay visible from afar, and have a shape of their own.
      const onFoot = l < 1.2, onTwoWheels = !onFoot && w < 1.2;
      const grow = Math.max(1, (onFoot ? 9 : 7) * px / Math.max(w, 0.1));
      c.save();
      c.translate(at[0], at[1]); c.rotate(at[2]);
      if (l < 2.5 && grow > 1) c.scale(grow, grow);
      c.fillStyle = colours[actor.role]; c.strokeStyle = colours.outline; c.lineWidth = (lead ? 1.6 : 1) * px / (l < 2.5 ? grow : 1);
      c.globalAlpha = actor.role === "ghost" ? 0.35 : 1;
      c.beginPath();
      if (onFoot) c.arc(0, 0, w / 2, 0, 7);
      else if (onTwoWheels) c.ellipse(0, 0, l / 2, w / 2, 0, 0, 7);
      else if (c.roundRect && l > 2.5) c.roundRect(-l / 2, -w / 2, l, w, Math.min(0.45, w / 4));
      else c.rect(-l / 2, -w / 2, l, w);
      c.fill(); c.stroke();
      if (onTwoWheels) { c.beginPath(); c.arc(0, 0, 0.28 * w, 0, 7); c.fillStyle = colours.outline; c.fill(); }
      if (l > 2.5) {
        c.globalAlpha *= 0.7; c.fillStyle = colours.outline;
        c.fillRect(0.12 * l, -0.39 * w, 0.14 * l, 0.78 * w);
      }
      if (actor === state.hover) {
        c.globalAlpha = 1; c.strokeStyle = colours.text; c.lineWidth = 2 * px; c.strokeRect(-l / 2 - 0.4, -w / 2 - 0.4, l + 0.8, w + 0.8);
      }
      c.restore();
    }

    function outlined(c, text, x, y, colour) {
      c.lineJoin = "round"; c.lineWidth = 3; c.strokeStyle = colours.ground; c.strokeText(text, x, y);
      c.fillStyle = colour; c.fillText(text, x, y);
    }

    // Names stand where no other name, no road user that leads and no contact is, and never beyond the edge.
    function drawNames(c) {
      const shown = [], taken = [];
      for (const actor of actors) {
        const at = pose(actor, state.time);
        if (!at) continue;
        const [x, y] = toScreen(at[0], at[1]), off = Math.max(8, actor.width_m * state.scale * 0.7), lead = LEADING.has(actor.role);
        if (x < 0 || y < 0 || x > width || y > height) continue;
        if (lead) taken.push([x - off, y - off, x + off, y + off]);
        if (lead || state.labels) shown.push({ actor, x, y, off, lead });
      }
      if (drawing.contact && state.time >= drawing.contact.step) {
        const [x, y] = toScreen(drawing.contact.point[0], drawing.contact.point[1]);
        taken.push([x - 20, y - 20, x + 20, y + 20]);
      }
      for (const { actor, x, y, off, lead } of shown.reverse()) {
        c.font = (lead ? "600 13px" : "11px") + " system-ui, sans-serif";
        const w = c.measureText(actor.label).width, h = lead ? 14 : 12;
        const places = [[off, -off], [off, off + h], [-off - w, -off], [-off - w, off + h], [off + 16, -off - 18], [-off - w - 16, -off - 18], [off + 16, off + h + 18], [-off - w - 16, off + h + 18], [-w / 2, -off - 24], [-w / 2, off + h + 24]];
        const boxes = places.map(([dx, dy]) => [x + dx, y + dy - h, x + dx + w, y + dy]);
        const inside = (b) => b[0] >= 2 && b[1] >= 2 && b[2] <= width - 2 && b[3] <= height - 2;
        const free = (b) => inside(b) && !taken.some((t) => b[0] < t[2] && t[0] < b[2] && b[1] < t[3] && t[1] < b[3]);
        const box = boxes.find(free) || (lead ? boxes.find(inside) : null);
        if (!box) continue;
        taken.push(box);
        // A name that has to stand apart from its road user is led to it.
        const [nx, ny] = [Math.max(box[0], Math.min(x, box[2])), Math.max(box[1], Math.min(y, box[3]))];
        if (Math.hypot(nx - x, ny - y) > off + 12) {
          c.strokeStyle = colours.text; c.lineWidth = 1;
          c.beginPath(); c.moveTo(nx, ny); c.lineTo(x, y); c.stroke();
        }
        outlined(c, actor.label, box[0], box[3] - 3, colours.text);
      }
    }

    function drawContact(c) {
      const contact = drawing.contact;
      if (!contact || state.time < contact.step) return;
      const [x, y] = toScreen(contact.point[0], contact.point[1]);
      c.strokeStyle = colours.contact; c.lineWidth = 2.5;
      c.beginPath(); c.arc(x, y, 14, 0, 7); c.stroke();
      c.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) { c.moveTo(x + 9 * dx, y + 9 * dy); c.lineTo(x + 21 * dx, y + 21 * dy); }
      c.stroke();
    }

    function drawScale(c) {
      const reach = 0.2 * width / state.scale;
      const length = [1000, 500, 200, 100, 50, 20, 10, 5, 2, 1].find((l) => l <= reach) || 1;
      const [x, y, w] = [16, height - 16, length * state.scale];
      c.strokeStyle = colours.text; c.lineWidth = 2;
      c.beginPath(); c.moveTo(x, y - 6); c.lineTo(x, y); c.lineTo(x + w, y); c.lineTo(x + w, y - 6); c.stroke();
      c.font = "12px system-ui, sans-serif";
      outlined(c, length + " m", x + w + 8, y + 1, colours.text);
    }

    function updateReadout() {
      const now = seconds(state.time);
      clock.textContent = `${now.toFixed(1)} s of ${seconds(last).toFixed(1)}`;
      slider.value = Math.round(state.time);
      slider.setAttribute("aria-valuetext", now.toFixed(1) + " seconds");
      readout.textContent = "";
      const at = ego && pose(ego, state.time);
      if (at) readout.append(element("b", { textContent: at[3].toFixed(1) + " m/s" }), "ego, " + (at[3] * 3.6).toFixed(0) + " km/h");
      if (drawing.contact && state.time >= drawing.contact.step) {
        readout.append(element("div", { className: "evo-hit", textContent: drawing.contact.label }));
      }
      readout.hidden = !readout.textContent;
    }

    function refresh() {
      play.textContent = state.playing ? "Pause" : state.time >= last ? "Replay" : "Play";
      for (const [button, key] of [[follow, "follow"], [trails, "trails"], [labels, "labels"]]) button.setAttribute("aria-pressed", state[key]);
      if (!state.playing) draw();
    }

    function tick(stamp) {
      if (!state.playing) return;
      if (state.clock !== null) state.time += ((stamp - state.clock) / 1000 / drawing.dt_s) * state.speed;
      state.clock = stamp;
      if (state.time >= last) { state.time = last; pause(); return; }
      draw();
      frame = requestAnimationFrame(tick);
    }

    function start() {
      if (state.playing || last === 0) return;
      if (state.time >= last) state.time = 0;
      state.playing = true; state.clock = null;
      frame = requestAnimationFrame(tick);
      refresh();
    }

    function pause() { state.playing = false; cancelAnimationFrame(frame); refresh(); }

    function seek(step) { state.time = Math.min(last, Math.max(0, step)); state.clock = null; if (state.playing) draw(); else refresh(); }

    function zoom(factor, px, py) {
      const [x, y] = toWorld(px, py);
      state.scale = Math.min(120, Math.max(0.05, state.scale * factor));
      if (!state.follow) {
        const [nx, ny] = toWorld(px, py);
        state.x += x - nx; state.y += y - ny;
      }
      if (!state.playing) draw();
    }

    function paceBy(by) {
      const k = Math.min(SPEEDS.length - 1, Math.max(0, SPEEDS.indexOf(state.speed) + by));
      state.speed = SPEEDS[k]; speed.value = state.speed;
    }

    function switchTheme() { root.dataset.theme = isDark() ? "light" : "dark"; readColours(); draw(); }

    play.addEventListener("click", () => (state.playing ? pause() : start()));
    slider.addEventListener("input", () => { const to = Number(slider.value); pause(); seek(to); });
    speed.addEventListener("change", () => { state.speed = Number(speed.value); });
    fit.addEventListener("click", () => { state.follow = false; showAll(true); refresh(); draw(); });
    theme.addEventListener("click", switchTheme);

    const KEYS = {
      " ": () => (state.playing ? pause() : start()),
      ArrowRight: (e) => { pause(); seek(Math.floor(state.time + 1e-9) + (e.shiftKey ? 10 : 1)); },
      ArrowLeft: (e) => { pause(); seek(Math.ceil(state.time - 1e-9) - (e.shiftKey ? 10 : 1)); },
      Home: () => seek(0), End: () => { pause(); seek(last); },
      "+": () => zoom(1.25, width / 2, height / 2), "=": () => zoom(1.25, width / 2, height / 2),
      "-": () => zoom(0.8, width / 2, height / 2),
      "[": () => paceBy(-1), "]": () => paceBy(1),
      f: () => { if (ego) { state.follow = !state.follow; refresh(); } },
      t: () => { state.trails = !state.trails; refresh(); }, l: () => { state.labels = !state.labels; refresh(); },
      r: () => fit.click(), d: switchTheme,
    };
    root.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const control = event.target !== canvas;
      if (control && (event.target === speed || [" ", "Home", "End"].includes(event.key) || (event.target === slider && event.key.startsWith("Arrow")))) return;
      const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (act) { event.preventDefault(); act(event); }
    });

    const pointers = new Map();
    const local = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); pointers.set(event.pointerId, local(event)); canvas.focus({ preventScroll: true }); });
    canvas.addEventListener("pointermove", (event) => {
      const at = local(event), before = pointers.get(event.pointerId);
      if (!before) { hover(at); return; }
      if (pointers.size === 2) {
        const other = [...pointers.entries()].find(([id]) => id !== event.pointerId)[1];
        const spread = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
        if (spread(before) > 5) zoom(spread(at) / spread(before), (at[0] + other[0]) / 2, (at[1] + other[1]) / 2);
      } else {
        if (state.follow) { state.follow = false; refresh(); }
        state.x -= (at[0] - before[0]) / state.scale; state.y += (at[1] - before[1]) / state.scale;
        if (!state.playing) draw();
      }
      pointers.set(event.pointerId, at);
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    canvas.addEventListener("pointerleave", () => hover(null));
    canvas.addEventListener("dblclick", () => { showAll(false); refresh(); draw(); });
    // In a page that scrolls, the wheel zooms only once the picture has the focus.
    canvas.addEventListener("wheel", (event) => {
      if (!options.fill && document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      zoom(Math.exp(-event.deltaY * 0.0015), ...local(event));
    }, { passive: false });

    function hover(at) {
      let found = null, best = 3.5 + 6 / state.scale;
      if (at) {
        const [x, y] = toWorld(...at);
        for (const actor of actors) {
          const p = pose(actor, state.time);
          const d = p ? Math.hypot(p[0] - x, p[1] - y) : Infinity;
          if (d < best) { best = d; found = [actor, p]; }
        }
      }
      const changed = state.hover !== (found && found[0]);
      state.hover = found && found[0];
      tip.hidden = !found;
      if (found) {
        const [actor, p] = found;
        tip.textContent = `${actor.label}, ${ROLES[actor.role]}, ${p[3].toFixed(1)} m/s, ${actor.length_m.toFixed(1)} × ${actor.width_m.toFixed(1)} m`;
        tip.style.left = Math.min(at[0] + 14, width - tip.offsetWidth - 6) + "px";
        tip.style.top = Math.max(6, at[1] - 32) + "px";
      }
      if (changed && !state.playing) draw();
    }

    const observer = new ResizeObserver(resize);
    observer.observe(stage);
    const scheme = matchMedia("(prefers-color-scheme: dark)");
    const schemeChanged = () => { readColours(); draw(); };
    scheme.addEventListener("change", schemeChanged);
    readColours(); resize(); refresh();
    if (options.autoplay && !matchMedia("(prefers-reduced-motion: reduce)").matches) start();
    return {
      seek, play: start, pause,
      destroy() { pause(); observer.disconnect(); scheme.removeEventListener("change", schemeChanged); stage.remove(); bar.remove(); },
    };
  }

  return { mount };
})();
