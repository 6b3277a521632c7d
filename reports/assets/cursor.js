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
  const bus = { plots: [], photos: [], links: [], watchers: [], zoomWatchers: [], moving: false, zooming: false, last: null, view: null };

  /* Each link in both directions: source, target, places on either. */
  bus.ways = () => bus.links.flatMap((link) => [
    [link.source, link.target, link.source_x, link.target_x],
    [link.target, link.source, link.target_x, link.source_x],
  ]);

  /* Where the cursor is in every domain that links reach from one. */
  bus.everywhere = (domain, x) => {
    const at = new Map([[domain, x]]);
    for (let round = 0; round < 2; round++) {
      for (const [source, target, from, to] of bus.ways()) {
        if (!at.has(source) || at.has(target)) continue;
        const there = across(from, to, at.get(source));
        if (there !== null) at.set(target, there);
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
    if (bus.moving || bus.zooming || u.cursor.left < 0 || u.cursor.idx === null || u.cursor.idx === undefined) return;
    bus.show(plot.spec.domain, u.data[0][u.cursor.idx], plot);
  };

  /* The ranges that links make of one, cut where a link ends; none where it says nothing. */
  bus.ranges = (domain, low, high) => {
    const found = new Map([[domain, [low, high]]]);
    for (let round = 0; round < 2; round++) {
      for (const [source, target, from, to] of bus.ways()) {
        if (!found.has(source) || found.has(target) || from.length < 2) continue;
        const [start, end] = found.get(source);
        const ends = [Math.max(start, from[0]), Math.min(end, from[from.length - 1])];
        if (ends[0] < ends[1]) found.set(target, ends.map((x) => across(from, to, x)));
      }
    }
    return found;
  };

  /* Shows low to high of a domain in all its plots, and what is tied to it in all others. */
  bus.zoom = (domain, low, high) => {
    if (!(low < high)) return;
    bus.zooming = true;
    const ranges = bus.ranges(domain, low, high);
    for (const plot of bus.plots) {
      const range = ranges.get(plot.spec.domain);
      if (range === undefined || plot.extent[1] < range[0] || plot.extent[0] > range[1]) continue;
      setRange(plot, range[0], range[1]);
    }
    bus.settle({ domain, low, high });
  };

  bus.whole = () => {
    bus.zooming = true;
    for (const plot of bus.plots) setRange(plot, plot.extent[0], plot.extent[1]);
    bus.settle(null);
  };

  /* Plots take a new range in a microtask and then move their cursors: ours is put back once. */
  bus.settle = (view) => {
    bus.view = view;
    queueMicrotask(() => {
      bus.zooming = false;
      if (bus.last !== null) bus.show(bus.last.domain, bus.last.x);
      bus.zoomWatchers.forEach((watch) => watch());
    });
  };

  /* A plot was zoomed by its own means (dragging, double click). */
  bus.zoomed = (origin, min, max) => {
    if (bus.zooming || min === undefined || min === null) return;
    if (min <= origin.extent[0] && max >= origin.extent[1]) bus.whole();
    else bus.zoom(origin.spec.domain, min, max);
  };

  /* Zooms about the cursor, or about the middle of what is seen. */
  bus.scale = (plot, factor) => {
    const { min, max } = plot.u.scales.x;
    const at = plot.figure.dataset.cursor === undefined ? (min + max) / 2 : Number(plot.figure.dataset.cursor);
    const centre = at >= min && at <= max ? at : (min + max) / 2;
    const [low, high] = [centre - (centre - min) * factor, centre + (max - centre) * factor];
    bus.zoomed(plot, Math.max(low, plot.extent[0]), Math.min(high, plot.extent[1]));
  };

  /* Moves the view by a fraction of it, never beyond the data. */
  bus.pan = (plot, fraction) => {
    const { min, max } = plot.u.scales.x;
    const wanted = fraction * (max - min);
    const step = Math.min(Math.max(wanted, plot.extent[0] - min), plot.extent[1] - max);
    if (step) bus.zoom(plot.spec.domain, min + step, max + step);
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
  if (!isOrigin) u.setCursor({ left: u.valToPos(x, "x"), top: u.bbox.height / devicePixelRatio / 2 }, false);
}

function setRange(plot, min, max) {
  const { x } = plot.u.scales;
  if (x.min !== min || x.max !== max) plot.u.setScale("x", { min, max });
}

/* Keys on a plot: arrows move the cursor (with Shift faster, with Ctrl the view), + and - zoom. */
function watchKeys(plot, bus) {
  const { figure, u, spec } = plot;
  const stage = figure.querySelector(".live");
  stage.tabIndex = 0;
  stage.setAttribute("role", "group");
  stage.setAttribute("aria-label", `${spec.title}. Arrow keys move the cursor, with Shift faster, with Control the view; plus and minus zoom; Escape shows all.`);
  const acts = { Escape: () => bus.whole(), "+": () => bus.scale(plot, 0.5), "=": () => bus.scale(plot, 0.5), "-": () => bus.scale(plot, 2) };
  stage.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.metaKey || event.altKey || (event.ctrlKey && !way)) return;
    if (acts[event.key]) { event.preventDefault(); acts[event.key](); return; }
    if (!way) return;
    event.preventDefault();
    if (event.ctrlKey) { bus.pan(plot, way / 4); return; }
    const xs = u.data[0];
    const from = figure.dataset.cursor === undefined ? u.scales.x.min : Number(figure.dataset.cursor);
    const target = event.shiftKey
      ? nearest(xs, from + (way * (u.scales.x.max - u.scales.x.min)) / 100)
      : nearest(xs, from) + way;
    bus.show(spec.domain, xs[Math.min(Math.max(target, 0), xs.length - 1)]);
  });
  stage.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    bus.scale(plot, event.deltaY > 0 ? 1.25 : 0.8);
  }, { passive: false });
}
