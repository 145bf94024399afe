// What the page knows: the site, its floors, everybody's track. Whoever draws listens for changes.

import { get } from "/web/api.js";
import { Frame } from "/web/frames.js";

const TRAIL = 240; // places kept of each track
const QUIET_S = 30; // without a word a track is drawn pale
const CROSSINGS = 100; // zones entered and left that are kept
const GONE_S = 900; // and then no longer; it can still be replayed

const hasPlace = (p) => p.x !== null && p.state !== "initialising";
const placeIn = ({ n, t, floor, x, y }) => ({ n, t, floor, x, y });

class Store extends EventTarget {
  site = "";
  floors = []; // { floor, level, frame, is_on_earth }
  floor = 0;
  selected = "";
  following = true;
  tracks = new Map(); // by name: { p (properties of its last position), trail, changed }
  plans = new Map();
  crossings = []; // rooms and geofences entered and left since the page was opened, the last first
  ahead = 0; // s, the server's clock before this one's

  tell(what) {
    this.dispatchEvent(new Event(what));
  }

  on(what, work) {
    for (const each of what.split(" ")) this.addEventListener(each, work);
  }

  get now() {
    return Date.now() / 1000 + this.ahead;
  }

  async open(site) {
    const { site: name, floors } = await get("/api/v1/plan", { site });
    this.site = name;
    this.floors = floors.map((f) => ({ ...f, frame: new Frame(f) }));
    this.tracks.clear();
    this.plans.clear();
    this.crossings = [];
    this.selected = "";
    const ground = this.floors.findIndex((f) => f.elevation_m >= 0);
    this.floor = Math.max(ground, 0);
    this.tell("site");
    this.tell("floor");
    this.tell("select");
  }

  /** The plan of a floor, fetched once. */
  async plan(floor) {
    if (!this.plans.has(floor)) {
      const of = get(`/api/v1/plan/${floor}`, { site: this.site });
      this.plans.set(floor, of);
      of.catch(() => this.plans.delete(floor));
    }
    return this.plans.get(floor);
  }

  showFloor(floor) {
    if (floor === this.floor || !this.floors[floor]) return;
    this.floor = floor;
    this.tell("floor");
  }

  select(track, { follow = true } = {}) {
    if (track !== this.selected) {
      this.selected = track;
      this.following = follow;
      this.tell("select");
    }
    const at = this.tracks.get(track);
    if (at && follow) this.showFloor(at.p.floor);
    if (at) this.#recall(track);
  }

  /** Where a track was before this page was opened. */
  async #recall(track) {
    const { features } = await get(`/api/v1/tracks/${track}/estimates`, { limit: TRAIL }).catch(() => ({ features: [] }));
    const at = this.tracks.get(track);
    if (!at || !features.length) return;
    const known = at.trail.filter((place) => place.n > features.at(-1).properties.n);
    const before = features.map((f) => f.properties).filter(hasPlace).map(placeIn);
    this.tracks.set(track, { ...at, trail: [...before, ...known].slice(-TRAIL) });
    this.tell("tracks");
  }

  /** Take an event of the stream. */
  take(event, data) {
    if (event === "snapshot") for (const f of data) this.#place(f.properties, f.properties.n);
    if (event === "position" && data.feature) {
      const p = data.feature.properties;
      this.ahead = p.heard - Date.now() / 1000;
      this.#place(p, data.changed);
    }
    if (event === "zone") this.#cross(data);
    for (const [track, { p }] of this.tracks) if (track !== this.selected && this.now - p.heard > GONE_S) this.tracks.delete(track);
    this.tell("tracks");
  }

  #cross(crossing) {
    this.crossings = [crossing, ...this.crossings].slice(0, CROSSINGS);
    this.tell("zones");
  }

  #place(p, changed) {
    const known = this.tracks.get(p.track) ?? { trail: [] };
    const trail = known.trail.filter((at) => at.n < Math.min(changed, p.n));
    if (hasPlace(p)) trail.push(placeIn(p));
    this.tracks.set(p.track, { p, trail: trail.slice(-TRAIL) });
    if (p.track === this.selected && this.following) this.showFloor(p.floor);
  }

  isQuiet(p) {
    return p.is_ended || this.now - p.heard > QUIET_S;
  }
}

export const store = new Store();

/** A name short enough for a map. */
export const short = (track) => track.slice(0, 6);
