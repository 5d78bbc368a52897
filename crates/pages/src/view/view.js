(() => {
  "use strict";
  const root = document.getElementById("view");
  const data = JSON.parse(document.getElementById("view-data").textContent);
  const find = (name) => root.querySelector("." + name);
  const canvas = find("world"), bar = find("bar"), clock = find("clock"), play = find("play"), speed = find("speed");

  // Places of a body: x, y, z and a quaternion for each picture.
  const bodies = data.bodies.map((body) => ({ ...body, places: scrnnFloats(body.places) }));
  const times = data.times, last = times.length - 1;

  // The picture at a time, with what lies between two pictures in proportion.
  const placeOf = (body, time) => {
    const all = body.places;
    if (all.length <= 7 || last < 1) return Array.from(all.subarray(0, 7));
    let low = 0, high = last;
    while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= time) low = middle; else high = middle; }
    if (time >= times[last]) return Array.from(all.subarray(7 * last, 7 * last + 7));
    const span = times[high] - times[low], share = span > 0 ? Math.min(1, Math.max(0, (time - times[low]) / span)) : 0;
    return scrnnBetween(all.subarray(7 * low, 7 * low + 7), all.subarray(7 * high, 7 * high + 7), share);
  };

  let now = 0, playing = false, before = 0;
  const scene = scrnnScene(canvas, () => bodies, (body) => placeOf(body, now), { " ": () => set(!playing) });
  if (!bodies.length) canvas.hidden = true;
  else if (!scene.works) {
    canvas.hidden = true;
    find("missing").hidden = false;
    find("missing").textContent = "This browser has no WebGL: the robots cannot be drawn. The curves are below.";
  }
  // All that moves is in view at first.
  const home = () => {
    const moving = bodies.filter((body) => body.places.length > 7), places = [];
    for (const body of moving.length ? moving : bodies) for (let k = 0; k < body.places.length; k += 7 * Math.max(1, Math.floor(body.places.length / 700))) places.push(body.places.subarray(k, k + 3));
    scene.home(places);
  };

  const make = scrnnMake;
  const length = data.length || 1, across = (time) => (1000 * time) / length;
  const marks = find("marks");
  for (const { pair, times } of data.contacts) for (const time of times) make(make(marks, "line", { class: "contact", x1: across(time), x2: across(time), y1: 5, y2: 10 }), "title", {}, `${pair} touch at ${time.toFixed(1)} s`);
  for (const [kind, list] of [["event", data.events], ["sequence", data.sequences]]) for (const [time, words] of list) make(make(marks, "line", { class: kind, x1: across(time), x2: across(time), y1: 0, y2: kind === "event" ? 6 : 10, "stroke-width": 2 }), "title", {}, `${words} at ${time.toFixed(1)} s`);
  const nowMark = make(marks, "line", { class: "hand", y1: 0, y2: 10 });

  const hands = [];
  for (const { name, sensed, mean, variance } of data.signals) {
    const svg = make(find("signals"), "svg", { viewBox: "0 0 300 96", role: "img", "aria-label": `${name}: sensed, and predicted with two standard deviations` });
    const sd = new Map(variance[0].map((time, k) => [time, 2 * Math.sqrt(Math.max(0, variance[1][k]))]));
    let low = Infinity, high = -Infinity;
    for (const value of [...sensed[1], ...mean[1]]) { low = Math.min(low, value); high = Math.max(high, value); }
    if (!(high > low)) { low = (Number.isFinite(low) ? low : 0) - 0.5; high = low + 1; }
    const room = 0.1 * (high - low), x = (time) => (4 + (292 * time) / length).toFixed(1);
    const y = (value) => Math.min(95, Math.max(18, 92 - (70 * (value - low + room)) / (high - low + 2 * room))).toFixed(1);
    if (sd.size) {
      const up = mean[0].map((time, k) => `${x(time)},${y(mean[1][k] + (sd.get(time) || 0))}`), down = mean[0].map((time, k) => `${x(time)},${y(mean[1][k] - (sd.get(time) || 0))}`);
      make(svg, "polygon", { class: "band", points: up.concat(down.reverse()).join(" ") });
    }
    make(svg, "polyline", { class: "sensed", points: sensed[0].map((time, k) => `${x(time)},${y(sensed[1][k])}`).join(" ") });
    make(svg, "polyline", { class: "mean", points: mean[0].map((time, k) => `${x(time)},${y(mean[1][k])}`).join(" ") });
    make(svg, "text", { x: 4, y: 12 }, `${name}   ${Number(low.toPrecision(3))} to ${Number(high.toPrecision(3))}`);
    hands.push(make(svg, "line", { class: "hand", y1: 16, y2: 96 }));
    svg.addEventListener("click", (event) => { const box = svg.getBoundingClientRect(); go((((event.clientX - box.left) / box.width) * 300 - 4) / 292 * length); });
  }

  const happenings = [...data.events, ...data.sequences.map(([time, name]) => [time, `sequence ${name}`])].sort((a, b) => a[0] - b[0]);
  const show = () => {
    bar.value = now;
    clock.value = `${now.toFixed(1)} s`;
    bar.setAttribute("aria-valuetext", `${now.toFixed(1)} of ${data.length.toFixed(1)} seconds`);
    for (const hand of hands) { const x = 4 + (292 * now) / length; hand.setAttribute("x1", x); hand.setAttribute("x2", x); }
    for (const end of ["x1", "x2"]) nowMark.setAttribute(end, across(now));
    const past = happenings.filter(([time]) => time <= now + 1e-9);
    find("now").textContent = past.length ? `${past[past.length - 1][1]}, at ${past[past.length - 1][0].toFixed(1)} s` : "";
    scene.paint();
  };
  const go = (time) => { now = Math.min(data.length, Math.max(0, time)); show(); };
  const set = (on) => {
    playing = on;
    play.textContent = on ? "\u275a\u275a" : "\u25b6";
    play.setAttribute("aria-label", on ? "pause" : "play");
    if (!on) return;
    if (now >= data.length) now = 0;
    before = performance.now();
    requestAnimationFrame(next);
  };
  const next = (time) => {
    if (!playing) return;
    const passed = (Math.max(0, time - before) / 1000) * Number(speed.value);
    before = time;
    go(now + passed);
    if (now >= data.length) set(false); else requestAnimationFrame(next);
  };

  bar.max = data.length;
  bar.addEventListener("input", () => go(Number(bar.value)));
  play.addEventListener("click", () => set(!playing));
  find("home").addEventListener("click", () => { home(); scene.paint(); });
  home();
  show();
  // For tests, and for whoever wants the numbers.
  const { camera, project, measure } = scene;
  window.scrnnView = { data, camera, project, measure, go, set, placeOf, bodies, time: () => now, playing: () => playing };
})();
