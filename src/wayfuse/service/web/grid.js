// Grids over a floor as pictures: what a survey covers, how strong an access point is. With the scale beside the map.

import { byId, el } from "/web/dom.js";

// from pale to dark, apart also for people who do not tell red from green (after viridis and oranges)
export const RAMPS = {
  level: { stops: ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"], low: -95, high: -40, unit: "dBm", name: "Level" },
  distance: { stops: ["#deebf7", "#fee6ce", "#fdae6b", "#e6550d", "#7f2704"], low: 0, high: 12, unit: "m", name: "To the nearest fingerprint" },
};

const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));

/** Colour of a value: three numbers of 0 to 255. */
export function colourOf(ramp, value) {
  const share = Math.min(Math.max((value - ramp.low) / (ramp.high - ramp.low), 0), 1) * (ramp.stops.length - 1);
  const k = Math.min(Math.floor(share), ramp.stops.length - 2);
  const [a, b] = [rgb(ramp.stops[k]), rgb(ramp.stops[k + 1])];
  return a.map((from, c) => Math.round(from + (share - k) * (b[c] - from)));
}

/** Draw a grid of the server (rows from y = 0 on) over a floor. */
export function showGrid(map, frame, { origin: [x, y], cell_m: cell, values }, ramp, missing = null) {
  const [rows, columns] = [values.length, values[0].length];
  const canvas = el("canvas", { width: columns, height: rows });
  const pen = canvas.getContext("2d");
  const picture = pen.createImageData(columns, rows);
  for (let j = 0; j < rows; j++) {
    for (let i = 0; i < columns; i++) {
      const value = values[j][i] ?? missing;
      if (value === null) continue;
      picture.data.set([...colourOf(ramp, value), 255], 4 * ((rows - 1 - j) * columns + i));
    }
  }
  pen.putImageData(picture, 0, 0);
  const [east, north] = [x + columns * cell, y + rows * cell];
  map.raster(canvas, [frame.degrees(x, north), frame.degrees(east, north), frame.degrees(east, y), frame.degrees(x, y)]);
  showScale(ramp);
}

export function hideGrid(map) {
  map.raster(null);
  byId("legend").hidden = true;
}

function showScale(ramp) {
  const canvas = el("canvas", { width: 128, height: 1 });
  const pen = canvas.getContext("2d");
  for (let i = 0; i < 128; i++) {
    pen.fillStyle = `rgb(${colourOf(ramp, ramp.low + (i / 127) * (ramp.high - ramp.low)).join(" ")})`;
    pen.fillRect(i, 0, 1, 1);
  }
  byId("legend").replaceChildren(
    el("div", { textContent: ramp.name }),
    el("div", { className: "scale" }, el("span", { textContent: `${ramp.low}` }), canvas, el("span", { textContent: `${ramp.high} ${ramp.unit}` })));
  byId("legend").hidden = false;
}
