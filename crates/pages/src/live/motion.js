(() => {
  "use strict";
  // Frames that are kept, seconds (or samples) that are drawn, and how far behind the newest the picture is so that it moves evenly.
  const MOST = 1200, SPAN = 60, BEHIND = 0.3;
  const root = document.getElementById("motion"), find = (name) => root.querySelector("." + name);
  const canvas = find("world"), play = find("play");
  const state = { run: null, next: 0, polls: 0, failed: 0, finished: false, channels: [], unit: "s", pace: null, bodies: [], frames: [], look: null, note: "", shown: null, held: false };

  const placed = (index, time) => {
    const wanted = 7 * state.bodies.length, frames = state.frames;
    let after = null, before = null;
    for (let k = frames.length - 1; k >= 0; k--) {
      const one = frames[k];
      if (!one.places || one.places.length !== wanted) continue;
      if (one.t <= time) { before = one; break; }
      after = one;
    }
    const at = (frame) => frame.places.subarray(7 * index, 7 * index + 7);
    if (!before || !after) return before || after ? Array.from(at(before || after)) : null;
    return scrnnBetween(at(before), at(after), after.t > before.t ? (time - before.t) / (after.t - before.t) : 0);
  };
  let index = new Map();
  const scene = scrnnScene(canvas, () => state.bodies, (body) => placed(index.get(body), state.shown), {});
  const home = () => scene.home(state.bodies.filter((body) => !body.stands).map((body) => placed(index.get(body), state.shown)).filter(Boolean));

  const make = scrnnMake;
  const known = (value) => value !== null && value !== undefined;
  const round = (value) => Number(value.toPrecision(3));
  const line = (svg, kind, points) => { if (points.length) make(svg, "polyline", { class: kind, points: points.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" ") }); };
  const band = (svg, points) => {
    if (!points.length) return;
    // Below the name, and above the lower edge.
    const up = points.map(([x, y, dy]) => `${x.toFixed(1)},${Math.max(17, y - dy).toFixed(1)}`), down = points.map(([x, y, dy]) => `${x.toFixed(1)},${Math.min(96, y + dy).toFixed(1)}`);
    make(svg, "polygon", { class: "band", points: up.concat(down.reverse()).join(" ") });
  };

  // The last samples of each channel, with what was expected of them, and what is expected to come.
  const curves = () => {
    const all = find("signals");
    while (all.children.length < state.channels.length) make(all, "svg", { viewBox: "0 0 300 96", role: "img", "aria-label": state.channels[all.children.length] });
    const frames = state.frames.filter((frame) => frame.s);
    if (!frames.length) return;
    const end = frames[frames.length - 1].t, shown = frames.filter((frame) => frame.t >= end - SPAN), begin = Math.min(shown[0].t, end - 1);
    const { from, smoothed, forecast, variance } = state.look || { from: 0, smoothed: [], forecast: [], variance: [] };
    const step = state.unit === "s" ? 0 : 1, ahead = forecast.length * step, x = (time) => 4 + (292 * (time - begin)) / (end + ahead - begin);
    state.channels.forEach((name, i) => {
      const svg = all.children[i];
      svg.replaceChildren();
      let low = Infinity, high = -Infinity;
      const see = (value) => { if (known(value)) { low = Math.min(low, value); high = Math.max(high, value); } };
      for (const frame of shown) { see(frame.s[i]); if (frame.m) see(frame.m[i]); }
      for (const row of forecast) see(row[i]);
      if (!(high > low)) { low = (Number.isFinite(low) ? low : 0) - 0.5; high = low + 1; }
      const room = 0.1 * (high - low), scale = 70 / (high - low + 2 * room), y = (value) => Math.min(95, Math.max(18, 92 - scale * (value - low + room)));
      const sd = (v) => Math.min(60, 2 * scale * Math.sqrt(Math.max(0, v)));
      const expected = shown.filter((frame) => frame.m && known(frame.m[i]));
      band(svg, expected.filter((frame) => frame.v && known(frame.v[i])).map((frame) => [x(frame.t), y(frame.m[i]), sd(frame.v[i])]));
      const to_come = forecast.map((row, k) => [x(end + (k + 1) * step), row[i], variance[k] && variance[k][i]]).filter((one) => known(one[1]));
      band(svg, to_come.filter((one) => known(one[2])).map(([at, value, v]) => [at, y(value), sd(v)]));
      line(svg, "sensed", shown.filter((frame) => known(frame.s[i])).map((frame) => [x(frame.t), y(frame.s[i])]));
      line(svg, "mean", expected.map((frame) => [x(frame.t), y(frame.m[i])]));
      line(svg, "mean", to_come.map(([at, value]) => [at, y(value)]));
      line(svg, "smoothed", smoothed.map((row, k) => [from + k, row[i]]).filter(([at, value]) => known(value) && at >= begin).map(([at, value]) => [x(at), y(value)]));
      make(svg, "line", { class: "hand", x1: x(end), x2: x(end), y1: 16, y2: 96 });
      make(svg, "text", { x: 4, y: 12 }, `${name}   ${round(low)} to ${round(high)}`);
    });
    const svg = find("error"), errors = shown.filter((frame) => known(frame.e));
    svg.replaceChildren();
    if (!errors.length) return;
    const most = Math.max(...errors.map((frame) => frame.e)) || 1;
    const place = (frame) => [80 + (630 * (frame.t - begin)) / (end - begin || 1), 122 - (94 * frame.e) / most];
    make(svg, "polyline", { class: "axis", points: "80,26 80,122 710,122" });
    make(svg, "text", { x: 84, y: 18 }, "error of the prediction, in the network's units");
    make(svg, "text", { x: 74, y: 38, "text-anchor": "end" }, round(most));
    make(svg, "text", { x: 74, y: 122, "text-anchor": "end" }, "0");
    make(svg, "text", { x: 80, y: 144 }, at(begin));
    make(svg, "text", { x: 710, y: 144, "text-anchor": "end" }, at(end));
    line(svg, "off", errors.map(place));
  };

  const at = (time) => (state.unit === "s" ? `${time.toFixed(1)} s` : `sample ${time.toFixed(0)}`);
  const words = () => {
    const frames = state.frames, newest = frames[frames.length - 1];
    const off = frames.findLast((frame) => known(frame.e));
    const time = newest ? at(newest.t) : "", error = off ? `, error ${round(off.e)}` : "";
    find("stand").textContent = state.failed && !state.finished ? "There is no answer: it has ended, or is busy. Asking again." : state.finished ? `The end, after ${time}.` : newest ? `${time}${error}.${state.note ? " " + state.note : ""}` : "Waiting for the first sample.";
    const event = frames.findLast((frame) => frame.w && frame.t <= (state.shown ?? Infinity) + 1e-9);
    find("now").textContent = event ? `${event.w}, at ${at(event.t)}` : "";
    find("clock").textContent = state.held && state.shown !== null ? `held at ${at(state.shown)}` : "";
  };

  const take = (data) => {
    if (data.run !== state.run) Object.assign(state, { run: data.run, bodies: [], frames: [], look: null, shown: null, next: 0 });
    Object.assign(state, { channels: data.channels, unit: data.unit, pace: data.pace, note: data.note, finished: data.finished, look: data.look });
    const first = Boolean(data.bodies) && !state.bodies.length;
    if (data.bodies) {
      state.bodies = data.bodies;
      index = new Map(data.bodies.map((body, k) => [body, k]));
    }
    for (const frame of data.frames.slice(Math.max(0, state.next - data.first))) state.frames.push(frame.p ? { ...frame, places: scrnnFloats(frame.p), p: true } : frame);
    state.frames.splice(0, state.frames.length - MOST);
    state.next = data.next;
    if (first) {
      canvas.hidden = !scene.works;
      find("home").hidden = !scene.works;
      find("missing").hidden = scene.works;
      find("missing").textContent = "This browser has no WebGL: the robots cannot be drawn. The curves are below.";
      state.shown = state.frames[state.frames.length - 1]?.t ?? 0;
      home();
    }
  };

  let before = performance.now(), curved = 0;
  const draw = (time) => {
    const passed = Math.max(0, time - before) / 1000;
    before = time;
    const newest = state.frames[state.frames.length - 1];
    if (time - curved > 200 && (!newest || state.held)) { curved = time; words(); }
    if (newest && !state.held) {
      const behind = state.pace ? BEHIND * state.pace : 0;
      if (state.shown === null || !state.pace) state.shown = newest.t;
      else {
        const far = newest.t - state.shown;
        // Evenly, but never far behind; at the end up to the last.
        if (far > 4 * behind || far < 0) state.shown = newest.t - behind;
        else state.shown = Math.min(newest.t, state.shown + passed * state.pace * (far > 1.5 * behind ? 1.1 : far < 0.5 * behind && !state.finished ? 0.9 : 1));
      }
      if (state.bodies.length) scene.paint();
      if (time - curved > 200) { curved = time; curves(); words(); }
    }
    requestAnimationFrame(draw);
  };
  play.addEventListener("click", () => {
    state.held = !state.held;
    play.textContent = state.held ? "go on" : "hold";
    play.setAttribute("aria-pressed", String(state.held));
    words();
  });
  find("home").addEventListener("click", () => { home(); scene.paint(); });
  scrnnPoll(state, () => `data/${state.next}.json`, take, () => {}, () => (state.failed ? Math.min(5_000, 500 * state.failed) : state.finished ? 2_000 : 100));
  requestAnimationFrame(draw);
  // For tests, and for whoever wants the numbers.
  const { camera, project, measure } = scene;
  window.scrnnMotion = { state, camera, project, measure, placed };
})();
