// What is drawn, in which order, and in which colours: the style of the map. Labels are drawn with the browser's own fonts.

import { EMPTY } from "/web/frames.js";

const FONT = ["system-ui, sans-serif"];
const kind = (name) => ["==", ["get", "kind"], name];
const zoomed = (...stops) => ["interpolate", ["linear"], ["zoom"], ...stops];
// rooms people walk in are lighter than what fills the rest of a floor
const ROOMS = ["room", "walkway", "corridor", "hall", "office", "classroom", "lobby", "foyer", "conferenceroom"];

export const SOURCES = ["plan", "radii", "trails", "particles", "dots", "points", "next", "zones"];

const LAYERS = [
  { id: "ground", type: "background", paint: (p) => ({ "background-color": p.ground }) },
  { id: "outline", type: "fill", source: "plan", filter: kind("outline"), paint: (p) => ({ "fill-color": p.floor }) },
  {
    id: "units", type: "fill", source: "plan", filter: kind("unit"),
    paint: (p) => ({ "fill-color": ["case", ["in", ["get", "category"], ["literal", ROOMS]], p.room, p.unit] }),
  },
  { id: "connectors", type: "fill", source: "plan", filter: kind("connector"), paint: (p) => ({ "fill-color": p.connector }) },
  { id: "unit-edges", type: "line", source: "plan", filter: kind("unit"), paint: (p) => ({ "line-color": p.unitEdge, "line-width": 0.8 }) },
  {
    id: "walls", type: "line", source: "plan", filter: kind("wall"), layout: { "line-cap": "round" },
    paint: (p) => ({ "line-color": p.wall, "line-width": zoomed(17, 0.8, 20, 2.2, 23, 6) }),
  },
  {
    id: "doors", type: "line", source: "plan", filter: kind("door"),
    paint: (p) => ({ "line-color": p.door, "line-width": zoomed(17, 1.2, 20, 3, 23, 8) }),
  },
  { id: "edge", type: "line", source: "plan", filter: kind("outline"), paint: (p) => ({ "line-color": p.edge, "line-width": zoomed(15, 1, 20, 2) }) },
  {
    id: "zones", type: "fill", source: "zones",
    paint: (p) => ({ "fill-color": p.zone, "fill-opacity": ["case", ["get", "chosen"], 0.35, [">", ["get", "n"], 0], 0.2, 0] }),
  },
  {
    id: "fences", type: "line", source: "zones", filter: kind("geofence"),
    paint: (p) => ({ "line-color": p.zone, "line-width": 2, "line-dasharray": [4, 2] }),
  },
  {
    id: "landings", type: "symbol", source: "plan", filter: kind("landing"), minzoom: 17,
    layout: { "text-field": ["get", "label"], "text-font": FONT, "text-size": 11, "text-padding": 1, "text-max-width": 6 },
    paint: (p) => ({ "text-color": p.landing, "text-halo-color": p.halo, "text-halo-width": 1.5 }),
  },
  {
    id: "unit-names", type: "symbol", source: "plan", filter: kind("unit"), minzoom: 17.5,
    layout: { "text-field": ["get", "name"], "text-font": FONT, "text-size": zoomed(17.5, 10, 21, 14), "text-max-width": 8, "text-padding": 4 },
    paint: (p) => ({ "text-color": p.text, "text-halo-color": p.halo, "text-halo-width": 1.5, "text-opacity": 0.85 }),
  },
  {
    id: "fence-names", type: "symbol", source: "zones", filter: kind("geofence"), minzoom: 16,
    layout: { "text-field": ["get", "name"], "text-font": FONT, "text-size": 12, "symbol-placement": "line", "symbol-spacing": 600, "text-offset": [0, 0.8] },
    paint: (p) => ({ "text-color": p.zone, "text-halo-color": p.halo, "text-halo-width": 1.5 }),
  },
  { id: "radii-95", type: "fill", source: "radii", filter: ["==", ["get", "share"], 95], paint: () => ({ "fill-color": ["get", "colour"], "fill-opacity": 0.1 }) },
  { id: "radii-68", type: "fill", source: "radii", filter: ["==", ["get", "share"], 68], paint: () => ({ "fill-color": ["get", "colour"], "fill-opacity": 0.16 }) },
  {
    id: "radii-edge", type: "line", source: "radii", filter: ["==", ["get", "share"], 95],
    paint: () => ({ "line-color": ["get", "colour"], "line-width": 1, "line-dasharray": [3, 2] }),
  },
  {
    id: "trails", type: "line", source: "trails", layout: { "line-cap": "round", "line-join": "round" },
    paint: () => ({ "line-color": ["get", "colour"], "line-width": ["case", ["get", "selected"], 4, 2], "line-opacity": ["case", ["get", "selected"], 0.85, 0.5] }),
  },
  {
    id: "particles", type: "circle", source: "particles",
    paint: () => ({ "circle-radius": zoomed(17, 1.2, 21, 2.6), "circle-color": ["get", "colour"], "circle-opacity": ["get", "opacity"] }),
  },
  {
    id: "walked", type: "line", source: "points", filter: kind("way"), layout: { "line-cap": "round" },
    paint: (p) => ({ "line-color": p.point, "line-width": 2, "line-dasharray": [2, 2] }),
  },
  {
    id: "points", type: "circle", source: "points", filter: kind("tap"),
    paint: (p) => ({ "circle-radius": 5, "circle-color": p.point, "circle-stroke-color": p.halo, "circle-stroke-width": 1.5 }),
  },
  {
    id: "next", type: "circle", source: "next",
    paint: (p) => ({ "circle-radius": 11, "circle-color": p.next, "circle-stroke-color": p.halo, "circle-stroke-width": 2 }),
  },
  {
    id: "dots", type: "circle", source: "dots",
    paint: (p) => ({
      "circle-radius": ["case", ["get", "selected"], 9, 7],
      "circle-color": ["match", ["get", "state"], "tracking", ["get", "colour"], p.dotEdge],
      "circle-opacity": ["case", ["get", "quiet"], 0.5, 1],
      "circle-stroke-color": ["match", ["get", "state"], "tracking", p.dotEdge, "lost", p.lost, ["get", "colour"]],
      "circle-stroke-width": ["match", ["get", "state"], "tracking", 2.5, 3.5],
      "circle-stroke-opacity": ["case", ["get", "quiet"], 0.6, 1],
    }),
  },
  {
    id: "next-names", type: "symbol", source: "next",
    layout: { "text-field": ["get", "rank"], "text-font": FONT, "text-size": 13, "text-allow-overlap": true },
    paint: (p) => ({ "text-color": p.halo }),
  },
  {
    id: "dot-names", type: "symbol", source: "dots",
    layout: {
      "text-field": ["get", "label"], "text-font": FONT, "text-size": 12, "text-anchor": "top", "text-offset": [0, 0.9],
      "text-optional": true, "symbol-sort-key": ["case", ["get", "selected"], 0, 1],
    },
    paint: (p) => ({ "text-color": p.text, "text-halo-color": p.halo, "text-halo-width": 2 }),
  },
];

/** Below this layer rasters are put: over the floor, under walls, people and names. */
export const RASTER_BELOW = "unit-edges";

export function style(palette) {
  return {
    version: 8,
    sources: Object.fromEntries(SOURCES.map((name) => [name, { type: "geojson", data: EMPTY, maxzoom: 22, tolerance: 0.1 }])),
    layers: LAYERS.map(({ paint, ...rest }) => ({ ...rest, paint: paint(palette) })),
  };
}

/** Every colour anew, for another theme. */
export function recolour(map, palette) {
  for (const { id, paint } of LAYERS) {
    for (const [name, value] of Object.entries(paint(palette))) map.setPaintProperty(id, name, value);
  }
}
