// From what the store knows to what the map shows: the floor, people, their radii and trails. At most five times a second.

import { collection, feature } from "/web/frames.js";
import { notice } from "/web/dom.js";
import { short, store } from "/web/store.js";
import { onTheme, trackColour } from "/web/theme.js";

const EVERY_MS = 200;
const NAMES = { stairs: "Stairs", lift: "Lift", escalator: "Escalator", ramp: "Ramp" };

export function startDrawing(map) {
  let due = false;
  const draw = () => {
    due = false;
    if (!store.floors.length) return;
    const shown = replayed ?? [...store.tracks.values()];
    map.data("dots", collection(shown.filter(isHere).map(dot)));
    map.data("radii", collection(shown.filter(isHere).flatMap(radii)));
    map.data("trails", collection(shown.flatMap(trail)));
    const chosen = store.tracks.get(store.selected);
    if (chosen && store.following && !replayed && isHere(chosen)) map.follow(placeOf(chosen.p));
  };
  const soon = () => {
    if (!due) setTimeout(draw, EVERY_MS);
    due = true;
  };
  store.on("tracks select replay", soon);
  onTheme(soon);
  store.on("floor", async () => {
    draw();
    const floor = store.floor;
    try {
      const plan = await store.plan(floor);
      if (floor === store.floor) map.data("plan", labelled(plan));
      notice("");
    } catch (error) {
      notice(error.message);
    }
  });
  store.on("site", () => map.fit(whole()));
}

let replayed = null;

/** Show these instead of what is live: tracks as in the store; null: live again. */
export function showInstead(tracks) {
  replayed = tracks;
  store.tell("replay");
}

const isHere = ({ p }) => p.floor === store.floor && p.x !== null;
const frame = (floor) => store.floors[floor].frame;

export const placeOf = (p) => frame(p.floor).degrees(p.x, p.y);

/** The corners of all floors. */
export function whole() {
  const all = store.floors.map((f) => f.frame.bounds);
  const pick = (k, d, best) => best(...all.map((b) => b[k][d]));
  return [[pick(0, 0, Math.min), pick(0, 1, Math.min)], [pick(1, 0, Math.max), pick(1, 1, Math.max)]];
}

function dot({ p }) {
  const selected = p.track === store.selected;
  const said = { track: p.track, label: short(p.track), state: p.state, colour: trackColour(p.track), selected, quiet: !p.replay && store.isQuiet(p) };
  return feature(frame(p.floor).point(p.x, p.y), said);
}

function radii({ p }) {
  const colour = trackColour(p.track);
  return [[95, p.radius_m_95], [68, p.radius_m_68]]
    .filter(([, r]) => r)
    .map(([share, r]) => feature(frame(p.floor).circle(p.x, p.y, r), { share, colour }));
}

/** The stretches of a trail on this floor. */
function trail({ p, trail: places }) {
  const lines = [];
  let line = [];
  for (const at of places) {
    if (at.floor === store.floor) line.push(frame(at.floor).degrees(at.x, at.y));
    else {
      lines.push(line);
      line = [];
    }
  }
  lines.push(line);
  const long = lines.filter((l) => l.length > 1);
  const said = { colour: trackColour(p.track), selected: p.track === store.selected };
  return long.length ? [feature({ type: "MultiLineString", coordinates: long }, said)] : [];
}

/** A plan with words on its landings, unless a unit says the same already. */
function labelled(plan) {
  const said = new Set(plan.features.filter((f) => f.properties.kind === "unit").map((f) => f.properties.name));
  const features = plan.features.map((f) => {
    if (f.properties.kind !== "landing") return f;
    const { name, category } = f.properties;
    const label = name || NAMES[category] || category;
    return { ...f, properties: { ...f.properties, label: said.has(label) ? "" : label } };
  });
  return collection(features);
}
