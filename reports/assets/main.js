/* Turns the drawings into live plots, one after the other, and ties them to the cursor. */

const json = (id) => JSON.parse(document.getElementById(id).textContent);

/* The bar under the page: a slider over the places of one domain, and what was there in words. */
const MOST_WORDS = 3;

function wordsAt(bus, at, domain) {
  const words = [];
  const onSeam = Array.from(at.keys()).some((key) => key.includes("/seam"));
  for (const [key, x] of at) {
    if (onSeam && key.includes("/photo")) continue;
    if (key.includes("/own/")) continue;
    words.push(key.includes("/time") ? `t = ${x.toFixed(2)} s` : `s = ${x.toFixed(1)} ${key.endsWith("/px") ? "px" : "mm"}`);
  }
  const told = new Set();
  for (const { spec, u, words: tell, extent } of bus.plots) {
    const x = at.get(spec.domain);
    if (spec.domain !== domain || x === undefined || x < extent[0] || x > extent[1]) continue;
    tell(nearest(u.data[0], x)).forEach((text, i) => {
      const { label } = spec.series[i];
      if (told.size < MOST_WORDS && !told.has(label)) { told.add(label); words.push(`${label} ${text}`); }
    });
  }
  return words.join("  ·  ");
}

function makeSlider(bus, domain, places, name) {
  const slider = document.getElementById("cursor-place");
  const text = document.getElementById("cursor-text");
  document.getElementById("cursor-label").textContent = name;
  slider.max = String(places.length - 1);
  slider.addEventListener("input", () => bus.show(domain, places[Number(slider.value)]));
  bus.watchers.push((at) => {
    const here = at.get(domain);
    text.textContent = wordsAt(bus, at, domain);
    slider.setAttribute("aria-valuetext", text.textContent);
    if (here !== undefined) slider.value = String(nearest(places, here));
  });
  watchZoom(bus, domain);
  document.getElementById("cursor").hidden = false;
  document.body.classList.add("with-cursor");
  bus.show(domain, places[0]);
}

/* Zoom by buttons, for those without a mouse; they act on the plots that the slider moves along. */
function watchZoom(bus, domain) {
  const button = (name) => document.getElementById(`zoom-${name}`);
  const plot = bus.plots.find((one) => one.spec.domain === domain) ?? bus.plots[0];
  if (!plot) return;
  button("in").addEventListener("click", () => bus.scale(plot, 0.5));
  button("out").addEventListener("click", () => bus.scale(plot, 2));
  button("all").addEventListener("click", bus.whole);
  const tell = () => { button("out").disabled = button("all").disabled = bus.view === null; };
  bus.zoomWatchers.push(tell);
  tell();
}

function watchLinks(bus) {
  for (const link of document.querySelectorAll("a.place[data-domain]")) {
    link.addEventListener("click", () => bus.show(link.dataset.domain, Number(link.dataset.x)));
  }
}

async function enliven() {
  const report = json("seamlog-report");
  const read = columnReader(json("seamlog-data"));
  const bus = makeBus();
  watchTheme(() => bus.plots.forEach((plot) => plot.u.redraw(false)));
  for (const link of report.links) {
    bus.links.push({ ...link, source_x: await read(link.source_x), target_x: await read(link.target_x) });
  }
  const blocks = report.sections.flatMap((section) => section.blocks);
  const cameras = new Map();
  for (const block of blocks) {
    const figure = block.id === undefined ? null : document.getElementById(block.id);
    const photo = block.kind === "moment" ? block.photo : block.kind === "picture" ? block : null;
    if (photo?.track) bus.photos.push(await makePhoto(document.getElementById(photo.id), photo, read, bus));
    if (block.kind === "frames") cameras.set(block.id, makeFrames(figure, block));
    if (!block.kind.endsWith("_plot") || !block.live) continue;
    const plot = await makePlot(figure, block, read, bus);
    if (plot === null) continue;
    bus.plots.push(plot);
    watchKeys(plot, bus);
    watchExport(plot);
    figure.classList.add("is-live");
  }
  for (const block of blocks.filter((one) => one.kind === "moment" && one.frame)) {
    makeSeen(document.getElementById(block.id).querySelector(".seen"), cameras.get(block.frames_id));
  }
  bus.photos.push(...cameras.values());
  const [camera] = cameras.values();
  if (camera) makeFollower(camera, document.querySelectorAll(".moment .seen, figure.frames"));
  const photo = bus.photos.find((one) => one.isBead), plot = bus.plots[0];
  const tie = photo && bus.links.find((one) => one.source === photo.domain);
  const link = photo ? bus.links.find((one) => tie && one.source === tie.target) : bus.links[0];
  if (link) makeSlider(bus, link.source, link.source_x, "Along the seam");
  else if (photo) makeSlider(bus, photo.domain, photo.x, "Along the bead");
  else if (plot) makeSlider(bus, plot.spec.domain, plot.u.data[0], "Place");
  watchLinks(bus);
  const first = blocks.find((one) => one.kind === "moment" && one.place && one.place.domain !== null);
  if (first) bus.show(first.place.domain, first.place.x);
  /* For scripts in the console and for tests: the cursor and the zoom of each domain. */
  window.seamlog = Object.freeze({ show: bus.show, zoom: bus.zoom, whole: bus.whole });
}

enliven()
  .then(() => { document.documentElement.dataset.state = "live"; })
  .catch((error) => {
    document.documentElement.dataset.state = "static";
    document.documentElement.dataset.reason = String(error);
  });
