(() => {
  "use strict";
  const root = document.getElementById("live"), find = (name) => root.querySelector("." + name);
  const make = scrnnMake;
  const words = scrnnWords;
  const range = (lists) => {
    let low = Infinity, high = -Infinity;
    for (const list of lists) for (const value of list) if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); }
    if (!(high > low)) { low = Number.isFinite(low) ? low - 0.5 : 0; high = low + 1; }
    return [low, high];
  };
  const line = (points) => points.filter(([, y]) => y !== null).map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" ");
  const learning = (data) => {
    const svg = find("curve");
    svg.replaceChildren();
    if (!data.curve.length) return;
    // What the first epochs come down from would flatten all the rest.
    const early = data.curve[Math.floor(data.curve.length / 20)][1];
    const [low, most] = range([data.curve.map((point) => point[1]), data.held_out.map((point) => point[1])]);
    const high = Math.max(low + 1e-9, Math.min(most, early + 0.1 * (early - low) || most)), end = Math.max(data.epoch, 1);
    const at = ([epoch, value]) => [60 + (640 * epoch) / end, 270 - 240 * Math.min(1, Math.max(0, (value - low) / (high - low)))];
    make(svg, "polyline", { class: "axis", points: "60,30 60,270 700,270" });
    make(svg, "text", { x: 54, y: 275, "text-anchor": "end" }, low.toPrecision(3));
    make(svg, "text", { x: 54, y: 38, "text-anchor": "end" }, high.toPrecision(3));
    make(svg, "text", { x: 700, y: 290, "text-anchor": "end" }, `epoch ${data.epoch}`);
    make(svg, "text", { x: 64, y: 18 }, `${data.with_variance ? "nll, nats per step and channel" : "log10 of the squared error"}${data.held_out.length ? "; in ochre on what is held out" : ""}`);
    make(svg, "polyline", { class: "ours", points: line(data.curve.map(at)) });
    if (data.held_out.length) make(svg, "polyline", { class: "held", points: line(data.held_out.map(at)) });
  };
  let shown = "";
  const loops = (data) => {
    const key = data && String(data.epoch);
    if (!data || key === shown) return;
    shown = key;
    find("best").textContent = `The best network on its own, epoch ${data.epoch}`;
    const all = find("loops");
    all.replaceChildren();
    data.sequences.forEach((sequence) => sequence.channels.forEach((channel, i) => {
      const svg = make(all, "svg", { viewBox: "0 0 300 120", role: "img", "aria-label": `${sequence.name}, ${data.channels[i]}` }), length = channel.recorded.length;
      const [low, high] = range([channel.recorded, channel.own]), y = (value) => (value === null ? null : 112 - (88 * (value - low)) / (high - low));
      make(svg, "text", { x: 6, y: 15 }, `${sequence.name}, ${data.channels[i]}`);
      make(svg, "polyline", { class: "ours", points: line(channel.own.map((value, k) => [4 + (292 * (k + data.delay)) / length, y(value)])) });
      make(svg, "polyline", { class: "truth", points: line(channel.recorded.map((value, k) => [4 + (292 * k) / length, y(value)])) });
    }));
  };
  const state = { polls: 0, failed: 0, over: false };
  const draw = (data) => {
    const left = data.left === null ? "" : `, ${words(data.left)} left`;
    find("stand").textContent = data.finished ? `Finished at epoch ${data.epoch}.` : data.epoch ? `Epoch ${data.epoch} of ${data.epochs}${left}.` : "Waiting for the first epoch.";
    state.over = data.finished;
    const percent = (share) => `${Math.round(100 * share)} %`;
    find("calibration").textContent = data.calibration ? `On held-out sequences ${percent(data.calibration[0])} of the closed loop's errors lie within one predicted sd (68 % would be right), ${percent(data.calibration[1])} within two (95 %).` : "";
    const said = find("said");
    said.hidden = !data.said.length;
    said.textContent = data.said.join("\n");
    learning(data);
    loops(data.loop);
  };
  scrnnPoll(state, () => "data.json", draw, () => { if (!state.over) find("stand").textContent = "The training does not answer: it has ended, or is busy. Asking again."; }, () => Math.min(10_000, 1_000 * (1 + state.failed)));
  window.scrnnLive = state;
})();
