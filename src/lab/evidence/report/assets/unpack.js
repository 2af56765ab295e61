"use strict";
// Turns the data and the stage of the page (see report/packed.rs) into what it draws, a drawing when it is first played.
const EvoUnpack = (() => {
  const points = (packed) => {
    const out = [];
    let x = 0, y = 0;
    for (let k = 0; k < packed.length; k += 2) { x += packed[k]; y += packed[k + 1]; out.push([x / 100, y / 100]); }
    return out;
  };
  const actor = ({ steps, runs, ...rest }) => {
    const samples = new Array(steps).fill(null);
    for (const [first, differences] of runs) {
      let x = 0, y = 0, h = 0, v = 0;
      for (let k = 0; k < differences.length; k += 4) {
        x += differences[k]; y += differences[k + 1]; h += differences[k + 2]; v += differences[k + 3];
        samples[first + k / 4] = [x / 100, y / 100, h / 1000, v / 100];
      }
    }
    return { ...rest, samples };
  };
  const drawing = (packed) => ({
    ...packed, verges: packed.verges.map(points), surfaces: packed.surfaces.map(points), lines: packed.lines.map((l) => ({ ...l, points: points(l.points) })),
    crosswalks: packed.crosswalks.map(points), route: points(packed.route), actors: packed.actors.map(actor),
  });
  // The data of a large page are base64 of deflated JSON.
  const whole = async (held) => {
    if (typeof held !== "string") return held;
    if (typeof DecompressionStream === "undefined") throw new Error("This browser cannot unpack the page; open it in one of 2023 or later.");
    const bytes = Uint8Array.from(atob(held), (c) => c.charCodeAt(0));
    return JSON.parse(await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).text());
  };
  return { actor, drawing, whole };
})();
