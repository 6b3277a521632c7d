/* The bead photo: the cursor as a line from toe to toe, and the pointer as a source of places. */

const SVG = "http://www.w3.org/2000/svg";

async function makePhoto(figure, spec, read, bus) {
  const track = spec.track;
  const [x, leftX, leftY, rightX, rightY] = await Promise.all(
    [track.x, track.left_x_px, track.left_y_px, track.right_x_px, track.right_y_px].map(read));
  const marker = figure.querySelector(".marker");
  const line = document.createElementNS(SVG, "line");
  const halo = document.createElementNS(SVG, "line");
  halo.setAttribute("class", "halo");
  marker.append(halo, line);
  const known = Array.from(x.keys()).filter((i) => [leftX, leftY, rightX, rightY].every((c) => c[i] !== null));

  const show = (at) => {
    const inside = at !== undefined && at >= x[0] && at <= x[x.length - 1];
    marker.classList.toggle("on", inside);
    if (!inside) { delete figure.dataset.cursor; return; }
    const i = nearest(x, at);
    figure.dataset.cursor = String(x[i]);
    if (leftX[i] === null || rightX[i] === null) { marker.classList.remove("on"); return; }
    const middle = [(leftX[i] + rightX[i]) / 2, (leftY[i] + rightY[i]) / 2];
    const reach = (edge, centre) => centre + (edge - centre) * 1.6;
    for (const one of [halo, line]) {
      one.setAttribute("x1", reach(leftX[i], middle[0]));
      one.setAttribute("y1", reach(leftY[i], middle[1]));
      one.setAttribute("x2", reach(rightX[i], middle[0]));
      one.setAttribute("y2", reach(rightY[i], middle[1]));
    }
  };

  figure.querySelector(".stage").addEventListener("pointermove", (event) => {
    const { x: px, y: py } = new DOMPoint(event.clientX, event.clientY).matrixTransform(marker.getScreenCTM().inverse());
    let best = null, least = Infinity;
    for (const i of known) {
      const away = ((leftX[i] + rightX[i]) / 2 - px) ** 2 + ((leftY[i] + rightY[i]) / 2 - py) ** 2;
      if (away < least) { least = away; best = i; }
    }
    if (best !== null) bus.show(track.domain, x[best]);
  });
  return { domain: track.domain, x, show, isBead: true };
}
