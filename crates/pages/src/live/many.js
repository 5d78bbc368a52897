(() => {
  "use strict";
  // Rows of the table; thousands would say no more.
  const ROWS = 200;
  const root = document.getElementById("many"), find = (name) => root.querySelector("." + name);
  const make = scrnnMake;
  const words = scrnnWords;
  const state = { run: null, version: 0, polls: 0, failed: 0, over: false, runs: [] };
  const classes = { finished: "finished", "being trained": "working", failed: "failed" };
  const known = (value) => value !== null && value !== undefined;
  const round = (value) => Number(value.toPrecision(4));

  const mark = (k, on) => {
    for (const node of find("curves").querySelectorAll(`[data-run="${k}"]`)) node.classList.toggle("marked", on);
    const one = state.runs[k];
    find("key").textContent = on && one ? `${one.name}: ${one.state}, epoch ${one.epoch} of ${one.epochs}${known(one.value) ? `, ${round(one.value)}` : ""}` : state.key;
  };
  const curves = (data) => {
    const svg = find("curves");
    svg.replaceChildren();
    const drawn = state.runs.filter((one) => one && one.curve.length);
    state.key = drawn.some((one) => one.held_out.length) ? "Dashed: on what is held out." : "";
    if (!drawn.length) return;
    // What the first epochs come down from would flatten all the rest.
    let low = Infinity, high = -Infinity, most = -Infinity, end = 1;
    for (const one of drawn) {
      const values = one.curve.map((point) => point[1]).filter(known), held = one.held_out.map((point) => point[1]).filter(known);
      if (!values.length) continue;
      for (const value of values) { low = Math.min(low, value); most = Math.max(most, value); }
      for (const value of held) low = Math.min(low, value);
      high = Math.max(high, values[Math.floor(values.length / 20)], ...held.slice(-1));
      end = Math.max(end, one.epochs, one.epoch);
    }
    high = Math.min(most, high + 0.05 * (high - low));
    if (!(high > low)) { low = Number.isFinite(low) ? low - 0.5 : 0; high = low + 1; }
    const at = ([epoch, value]) => `${(60 + (640 * epoch) / end).toFixed(1)},${(310 - 280 * Math.min(1, Math.max(0, (value - low) / (high - low)))).toFixed(1)}`;
    make(svg, "polyline", { class: "axis", points: "60,30 60,310 700,310" });
    make(svg, "text", { x: 54, y: 315, "text-anchor": "end" }, round(low));
    make(svg, "text", { x: 54, y: 38, "text-anchor": "end" }, round(high));
    make(svg, "text", { x: 700, y: 330, "text-anchor": "end" }, `epoch ${end}`);
    make(svg, "text", { x: 64, y: 18 }, data.with_variance ? "nll, nats per step and channel" : "log10 of the squared error");
    for (const one of drawn) for (const [list, kind] of [[one.held_out, " held"], [one.curve, ""]]) {
      const points = list.filter((point) => known(point[1])).map(at);
      if (!points.length) continue;
      const node = make(svg, "polyline", { class: `curve ${classes[one.state] || ""}${kind}`, points: points.join(" "), "data-run": one.k });
      make(node, "title", {}, one.name);
      node.addEventListener("pointerenter", () => mark(one.k, true));
      node.addEventListener("pointerleave", () => mark(one.k, false));
    }
    find("key").textContent = state.key;
  };
  // Those that are worked on and those that failed stand first.
  const order = { "being trained": 0, failed: 1, interrupted: 2, finished: 3, "not begun": 4 };
  const table = (data) => {
    const body = find("runs");
    const shown = state.runs.filter(Boolean).sort((a, b) => order[a.state] - order[b.state] || a.k - b.k).slice(0, ROWS);
    const rows = shown.map((one) => {
      const row = document.createElement("tr");
      const cell = (text, kind) => { const node = document.createElement("td"); node.textContent = text; if (kind) node.className = kind; row.append(node); };
      cell(one.name);
      cell(one.state, one.state === "failed" ? "failed" : "");
      cell(`${one.epoch} of ${one.epochs}`, "n");
      cell(known(one.value) ? round(one.value) : "\u2013", "n");
      cell(one.message);
      row.addEventListener("pointerenter", () => mark(one.k, true));
      row.addEventListener("pointerleave", () => mark(one.k, false));
      return row;
    });
    body.replaceChildren(...rows);
    find("more").textContent = data.runs > shown.length ? `${data.runs - shown.length} more are not listed.` : "";
  };
  const take = (data) => {
    if (data.run !== state.run) Object.assign(state, { run: data.run, runs: [] });
    state.version = data.version;
    state.over = data.finished;
    for (const one of data.changed) state.runs[one.k] = one;
    const counts = data.counts.filter(([, count]) => count).map(([word, count]) => `${count} ${word}`).join(", ");
    const left = data.left !== null && !data.finished ? ` About ${words(data.left)} left.` : "";
    find("stand").textContent = data.problem ? `The folder cannot be read: ${data.problem}` : data.runs ? `Of ${data.runs} runs: ${counts}.${left}` : "Waiting for the first run.";
    if (data.changed.length) { curves(data); table(data); }
  };
  scrnnPoll(state, () => `data/${state.version}.json`, take, () => { if (!state.over) find("stand").textContent = "There is no answer: it has ended, or is busy. Asking again."; }, () => Math.min(10_000, 1_000 * (1 + state.failed)));
  window.scrnnMany = state;
})();
