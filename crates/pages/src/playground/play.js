(() => {
  "use strict";
  const root = document.getElementById("playground");
  const { networks } = JSON.parse(document.getElementById("playground-data").textContent);
  const find = (name) => root.querySelector("." + name);
  const levels = ["var(--level-0)", "var(--level-1)", "var(--level-2)", "var(--level-3)"];
  const make = scrnnMake;
  const state = { at: [0, 0], nearest: 0, noise: false, seed: 1, push: 0, when: 20, channel: 0, steps: 1 };
  // The network that is played with, what runs it, and its plane: the room that is shown, and where a point of it lies.
  let data, net, n, delay, room, place;

  // Random numbers of a normal distribution, the same for the same seed.
  const normal = (seed) => {
    let a = seed >>> 0;
    const uniform = () => {
      a = (a + 0x6d2b79f5) >>> 0;
      let t = Math.imul(a ^ (a >>> 15), a | 1);
      t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
      return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
    };
    return () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform());
  };

  // The state that lies at a place of the plane; on a learned state, that very state.
  const internal = ([a, b]) => {
    const { points, internals, mean, axes } = data.plane;
    const exact = points.findIndex((point) => point[0] === a && point[1] === b);
    return exact >= 0 ? internals[exact] : mean.map((u, i) => u + a * axes[0][i] + b * axes[1][i]);
  };

  // The closed loop: what was predicted, with its noise if there is any, is what comes in when it is due.
  const run = ({ internal, others, first, steps, noise, seed, push, when, channel }) => {
    const now = net.begin([internal, ...(others || [])]), random = normal(seed), samples = [];
    const out = { mean: [], variance: [], sample: [], context: [] };
    for (let k = 0; k < steps; k++) {
      const x = k < delay ? first[k].slice() : samples[k - delay].slice();
      if (push && k === when) x[channel] += push;
      const { mean, variance, context } = net.step(now, x);
      const sample = mean.map((y, i) => (noise && variance ? y + Math.sqrt(variance[i]) * random() : y));
      samples.push(sample);
      out.mean.push(mean);
      out.variance.push(variance);
      out.sample.push(sample);
      out.context.push(Array.from(context));
    }
    return out;
  };

  const range = (values) => {
    let low = Infinity, high = -Infinity;
    for (const value of values) if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
    if (!(high > low)) return [Number.isFinite(low) ? low - 0.5 : 0, Number.isFinite(low) ? low + 0.5 : 1];
    const room = 0.06 * (high - low);
    return [low - room, high + room];
  };
  const short = (value) => String(Number(value.toPrecision(2)));

  // A pair of axes in a drawing, and how numbers lie between them.
  const axes = (svg, [left, top, width, height], [x0, x1], [y0, y1], label, numbers = true) => {
    make(svg, "polyline", { class: "axis", points: `${left},${top} ${left},${top + height} ${left + width},${top + height}` });
    for (const value of numbers ? [y0 + 0.1 * (y1 - y0), y1 - 0.1 * (y1 - y0)] : []) {
      const y = top + height - (height * (value - y0)) / (y1 - y0);
      make(svg, "text", { x: left - 4, y: y + 4, class: "tick end" }, short(value));
    }
    make(svg, "text", { x: left + 4, y: top - 4, class: "tick" }, label);
    const cut = (share) => Math.min(1.02, Math.max(-0.02, share));
    return ([x, y]) => [left + width * cut((x - x0) / (x1 - x0)), top + height * (1 - cut((y - y0) / (y1 - y0)))];
  };
  const path = (points) => points.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" ");

  // The plane of the initial states.
  const plane = find("plane");
  const [left, top, width, height] = [8, 18, 304, 274];
  const handle = make(plane, "circle", { r: 9, class: "handle", tabindex: 0, role: "slider", "aria-label": "initial state: arrow keys move it" });
  const drawPlane = () => {
    const spread = [0, 1].map((k) => range(data.plane.points.map((point) => point[k])));
    room = spread.map(([a, b]) => [a - 0.15 * (b - a), b + 0.15 * (b - a)]);
    plane.replaceChildren();
    place = axes(plane, [left, top, width, height], room[0], room[1], data.plane.label, false);
    data.plane.points.forEach((point, k) => {
      const [cx, cy] = place(point);
      const dot = make(plane, "circle", { cx, cy, r: 4, class: "learned", fill: levels[(data.plane.kinds[k] || 0) % 4] });
      make(dot, "title", {}, data.plane.names[k]);
    });
    plane.append(handle);
  };

  const draw = () => {
    const [cx, cy] = place(state.at);
    handle.setAttribute("cx", cx);
    handle.setAttribute("cy", cy);
    const apart = data.plane.points.map((point) => Math.hypot(point[0] - state.at[0], point[1] - state.at[1]));
    state.nearest = apart.indexOf(Math.min(...apart));
    const name = data.plane.names[state.nearest];
    handle.setAttribute("aria-valuetext", `${short(state.at[0])}, ${short(state.at[1])}, nearest to ${name}`);
    find("where").textContent = apart[state.nearest] === 0 ? `the state of sequence ${name}` : `between the learned states; nearest is that of sequence ${name}`;
    const ran = run({ ...state, internal: internal(state.at), others: data.plane.others[state.nearest], first: data.plane.begins[state.nearest] });
    const time = (k) => k + delay + 1;
    const paint = find("time");
    paint.replaceChildren();
    const shown = Math.min(n, 6), height = 300 / shown;
    for (let i = 0; i < shown; i++) {
      const sd = (k) => (ran.variance[k] ? 2 * Math.sqrt(ran.variance[k][i]) : 0);
      const at = axes(paint, [46, 14 + i * height, 430, height - 22], [0, state.steps + delay], data.ranges[i], data.network.channels[i]);
      if (ran.variance[0]) {
        const up = ran.mean.map((y, k) => at([time(k), y[i] + sd(k)])), down = ran.mean.map((y, k) => at([time(k), y[i] - sd(k)]));
        make(paint, "polygon", { class: "band", points: path(up.concat(down.reverse())) });
      }
      make(paint, "polyline", { class: "own", points: path(ran.sample.map((y, k) => at([time(k), y[i]]))) });
    }
    if (data.pair) {
      const [a, b] = data.pair, svg = find("orbit");
      svg.replaceChildren();
      const at = axes(svg, [46, 14, 266, 270], data.ranges[a], data.ranges[b], `${data.network.channels[b]} over ${data.network.channels[a]}`);
      make(svg, "polyline", { class: "own", points: path(ran.sample.map((y) => at([y[a], y[b]]))) });
    }
    const contexts = find("contexts"), units = Math.min(ran.context[0].length, 40);
    contexts.replaceChildren();
    const at = axes(contexts, [46, 14, 430, 110], [0, state.steps + delay], [-1.05, 1.05], `contexts of ${units} units`);
    for (let j = 0; j < units; j++) make(contexts, "polyline", { class: "context", stroke: levels[j % 4], points: path(ran.context.map((c, k) => at([time(k), c[j]]))) });
    make(contexts, "text", { x: 476, y: 135, class: "tick end" }, `step ${state.steps + delay}`);
    make(contexts, "text", { x: 46, y: 135, class: "tick" }, "1");
    return ran;
  };

  const back = ([x, y]) => [room[0][0] + ((x - left) / width) * (room[0][1] - room[0][0]), room[1][0] + ((top + height - y) / height) * (room[1][1] - room[1][0])];
  const clamp = (at) => at.map((value, k) => Math.min(room[k][1], Math.max(room[k][0], value)));
  const under = (event) => {
    const box = plane.getBoundingClientRect();
    const at = clamp(back([((event.clientX - box.left) / box.width) * 320, ((event.clientY - box.top) / box.height) * 300]));
    // Near a learned state, that state.
    const near = data.plane.points.find((point) => Math.hypot(...place(point).map((value, k) => value - place(at)[k])) < 6);
    state.at = near ? [...near] : at;
    draw();
  };
  plane.addEventListener("pointerdown", (event) => { plane.setPointerCapture(event.pointerId); handle.focus(); under(event); });
  plane.addEventListener("pointermove", (event) => { if (event.buttons) under(event); });
  handle.addEventListener("keydown", (event) => {
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }[event.key];
    if (!move) return;
    event.preventDefault();
    state.at = clamp(state.at.map((value, k) => value + (move[k] * (room[k][1] - room[k][0])) / 50));
    draw();
  });
  const control = (name, change) => {
    const node = find(name);
    if (node) node.addEventListener("input", () => { change(node); draw(); });
  };
  control("noise", (node) => { state.noise = node.checked; });
  const push = (node) => {
    const [low, high] = data.ranges[state.channel];
    state.push = (node.value / 100) * (high - low);
  };
  control("push", push);
  control("when", (node) => { state.when = Number(node.value); });
  control("channel", (node) => { state.channel = Number(node.value); find("push").dispatchEvent(new Event("input")); });
  find("again").addEventListener("click", () => { state.seed++; draw(); });

  // Another network begins from its own state of the sequence that is nearest; noise and push stay.
  const choose = (k) => {
    const before = data && data.plane.names[state.nearest];
    data = networks[k];
    net = scrnnStep(data.network);
    n = net.channels;
    delay = data.network.kind.delay;
    state.at = [...data.plane.points[Math.max(0, data.plane.names.indexOf(before))]];
    state.steps = data.steps;
    if (state.channel >= n) state.channel = 0;
    find("channel").replaceChildren(...data.network.channels.map((name, i) => new Option(name, i, false, i === state.channel)));
    find("when").max = state.steps - 1;
    state.when = Number(find("when").value);
    push(find("push"));
    for (const node of root.querySelectorAll(".noisy")) node.hidden = !data.network.kind.variance;
    find("orbit").style.display = data.pair ? "" : "none";
    find("about").textContent = data.about;
    drawPlane();
    draw();
  };
  networks.forEach(({ name }, k) => find("network").append(new Option(name, k)));
  find("which").hidden = networks.length < 2;
  find("network").addEventListener("input", (event) => choose(Number(event.target.value)));
  choose(0);
  // For tests, and for whoever wants the numbers.
  window.scrnnPlayground = { run: (options) => run({ ...state, internal: internal(state.at), others: data.plane.others[state.nearest], first: data.plane.begins[state.nearest], ...options }), state, draw, choose, networks, get data() { return data; }, get place() { return place; } };
})();
