// What several pages need. Functions, so that a page may hold it twice.
function scrnnMake(parent, name, attributes, text) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  parent.append(node);
  return node;
}

// Seconds, in words.
function scrnnWords(seconds) {
  const s = Math.round(seconds);
  return s < 60 ? `${s} s` : s < 3600 ? `${Math.floor(s / 60)} min ${s % 60} s` : s < 864e5 ? `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min` : "more than 1000 days";
}

// Asks this page's server again and again; counts answers and failures in a row.
function scrnnPoll(state, address, take, silent, pause) {
  const poll = async () => {
    try {
      const answer = await fetch(address(), { cache: "no-store" });
      if (!answer.ok) throw new Error(answer.status);
      take(await answer.json());
      state.failed = 0;
      state.polls++;
    } catch (error) {
      state.failed++;
      silent();
    }
    setTimeout(poll, pause());
  };
  poll();
}
