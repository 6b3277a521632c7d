/* One cursor over everything: plots and photos of a domain share it, links tie domains together. */

/* Index of the value of an ascending array nearest to x. */
function nearest(values, x) {
  let low = 0, high = values.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle; else high = middle;
  }
  return x - values[low] <= values[high] - x ? low : high;
}

/* Linear interpolation of `to` at x over ascending `from`; null outside. */
function across(from, to, x) {
  const last = from.length - 1;
  if (last < 1 || x < from[0] || x > from[last]) return null;
  let i = nearest(from, x);
  if (from[i] > x || i === last) i -= 1;
  i = Math.max(i, 0);
  const span = from[i + 1] - from[i];
  return span > 0 ? to[i] + ((to[i + 1] - to[i]) * (x - from[i])) / span : to[i];
}

function makeBus() {
  const bus = { plots: [], photos: [], links: [], watchers: [], moving: false, zooming: false, last: null };

  /* Where the cursor is in every domain that links reach from one. */
  bus.everywhere = (domain, x) => {
    const at = new Map([[domain, x]]);
    for (let round = 0; round < 2; round++) {
      for (const link of bus.links) {
        const ways = [[link.source, link.target, link.source_x, link.target_x], [link.target, link.source, link.target_x, link.source_x]];
        for (const [source, target, from, to] of ways) {
          if (!at.has(source) || at.has(target)) continue;
          const there = across(from, to, at.get(source));
          if (there !== null) at.set(target, there);
        }
      }
    }
    return at;
  };

  bus.show = (domain, x, origin = null) => {
    if (bus.moving) return;
    bus.moving = true;
    const at = bus.everywhere(domain, x);
    bus.last = { domain, x };
    for (const plot of bus.plots) place(plot, at.get(plot.spec.domain), plot === origin);
    for (const photo of bus.photos) photo.show(at.get(photo.domain));
    for (const watch of bus.watchers) watch(at);
    bus.moving = false;
  };

  bus.moved = (plot, u) => {
    if (bus.moving || u.cursor.left < 0 || u.cursor.idx === null || u.cursor.idx === undefined) return;
    bus.show(plot.spec.domain, u.data[0][u.cursor.idx], plot);
  };

  bus.zoomed = (origin, min, max) => {
    if (bus.zooming) return;
    bus.zooming = true;
    const whole = min <= origin.extent[0] && max >= origin.extent[1];
    for (const plot of bus.plots) {
      if (plot === origin || plot.spec.domain !== origin.spec.domain) continue;
      if (plot.extent[1] < min || plot.extent[0] > max) continue;
      const [low, high] = whole ? plot.extent : [min, max];
      plot.u.setScale("x", { min: low, max: high });
    }
    bus.zooming = false;
  };
  return bus;
}

function place(plot, x, isOrigin) {
  const { u, figure } = plot;
  const inside = x !== undefined && x >= plot.extent[0] && x <= plot.extent[1];
  if (!inside) {
    delete figure.dataset.cursor;
    plot.tell(null);
    if (!isOrigin) u.setCursor({ left: -10, top: -10 }, false);
    return;
  }
  const index = nearest(u.data[0], x);
  figure.dataset.cursor = String(u.data[0][index]);
  plot.tell(index);
  if (!isOrigin) u.setCursor({ left: u.valToPos(x, "x"), top: u.over.clientHeight / 2 }, false);
}

/* Arrow keys on a plot: one sample, with Shift a hundredth of the view. */
function watchKeys(plot, bus) {
  const { figure, u, spec } = plot;
  const stage = figure.querySelector(".live");
  stage.tabIndex = 0;
  stage.setAttribute("role", "group");
  stage.setAttribute("aria-label", `${spec.title}. Arrow keys move the cursor, with Shift faster; Escape shows all.`);
  stage.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      u.setScale("x", { min: plot.extent[0], max: plot.extent[1] });
      return;
    }
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!way) return;
    event.preventDefault();
    const xs = u.data[0];
    const from = figure.dataset.cursor === undefined ? u.scales.x.min : Number(figure.dataset.cursor);
    const target = event.shiftKey
      ? nearest(xs, from + (way * (u.scales.x.max - u.scales.x.min)) / 100)
      : nearest(xs, from) + way;
    bus.show(spec.domain, xs[Math.min(Math.max(target, 0), xs.length - 1)]);
  });
}
