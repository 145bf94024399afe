// Survey tools: record, upload, build, look, publish.

import { get, post, remove } from "/web/api.js";
import { action, ago, el, metres, percent, trying } from "/web/dom.js";
import { collection, feature } from "/web/frames.js";
import { store } from "/web/store.js";
import { startAnchors } from "/web/survey_anchors.js";
import { startPictures } from "/web/survey_pictures.js";
import { startRecord } from "/web/survey_record.js";
import { startImport } from "/web/survey_site.js";

const ASK_MS = 1000;

/** imported(name): a building was imported. */
export function startSurvey(view, map, imported) {
  const said = el("p", { className: "small", role: "status" });
  let last = null;
  let open = false;
  let pending = [];

  const draw = (taps = pending) => {
    pending = taps;
    if (!open || !last) return;
    const all = [...last.walks.map((w) => w.taps), pending];
    const here = all.map((of) => of.filter((tap) => tap.floor === store.floor)).filter((of) => of.length);
    const { frame } = store.floors[store.floor];
    const places = here.map((of) => of.map((t) => frame.degrees(t.x, t.y)));
    const lines = places.filter((of) => of.length > 1).map((of) => feature({ type: "LineString", coordinates: of }, { kind: "way" }));
    const spots = places.flat().map((place) => feature({ type: "Point", coordinates: place }, { kind: "tap" }));
    map.data("points", collection([...lines, ...spots]));
  };
  const ask = async () => {
    if (!store.site) return;
    last = await get("/api/v1/survey", { site: store.site });
    record.take(last);
    parts.take(last);
    builder.take(last.job);
    draw();
  };
  const record = startRecord(map, ask, draw);
  const parts = startParts(ask);
  const versions = startVersions(() => pictures.again());
  const builder = startBuilder(ask, versions.list);
  const pictures = startPictures(map);
  const anchors = startAnchors();
  const building = startImport(imported, anchors.element);
  view.append(said, pictures.element, record.element, parts.element, builder.element, versions.element, building.element);

  const tried = trying(said);
  setInterval(() => open && !document.hidden && tried(ask), ASK_MS);
  store.on("floor", () => draw());
  store.on("site", () => open && opened());
  const opened = async () => {
    open = true;
    anchors.element.hidden = !store.site;
    if (!store.site) {
      building.open();
      return;
    }
    await tried(ask);
    await tried(versions.list);
    await tried(anchors.list);
    await pictures.again();
  };
  const left = () => {
    open = false;
    record.left();
    pictures.clear();
    map.data("points", null);
  };
  return { opened, left };
}

/** What was collected, to be added to and deleted. */
function startParts(ask) {
  const list = el("ul", { className: "parts" });
  const summary = el("summary");
  const file = el("input", { type: "file", multiple: true, aria: { label: "Recordings with waypoints" } });
  const upload = action("Upload recordings", async () => {
    const names = [];
    for (const one of file.files) {
      const { waypoints, scans } = await post("/api/v1/survey/recordings", { site: store.site, name: one.name }, one);
      names.push(`${one.name}: ${waypoints} waypoints, ${scans} scans`);
    }
    file.value = "";
    await ask();
    return names.join("; ") || "Choose files first.";
  });
  const element = el("fieldset", {}, el("legend", { textContent: "Collected" }),
    el("details", {}, summary, list), file, upload);
  let shown = "";
  const drop = (id) => action("Delete", async () => {
    await remove(`/api/v1/survey/parts/${id}`, { site: store.site });
    await ask();
  });
  const take = ({ walks, recordings }) => {
    const now = JSON.stringify([walks.map((w) => w.id), recordings.map((r) => r.id)]);
    if (now === shown) return;
    shown = now;
    summary.textContent = `${walks.length} walks by hand, ${recordings.length} recordings`;
    list.replaceChildren(
      ...walks.map((w) => el("li", {}, `Level ${store.floors[w.taps[0].floor]?.level}: ${w.taps.length} taps, ${Math.round(w.taps.at(-1).t - w.taps[0].t)} s, ${ago(store.now - w.taps[0].t)}`, drop(w.id))),
      ...recordings.map((r) => el("li", {}, r.name, drop(r.id))));
  };
  return { element, take };
}

/** The job that builds, its progress, and the held-out errors it found. */
function startBuilder(ask, built) {
  const bar = el("progress", { max: 1, value: 0, hidden: true, aria: { label: "Progress" } });
  const said = el("p", { className: "small", role: "status" });
  const rooms = el("tbody");
  const table = el("table", { hidden: true }, head("Level", "Room", "n", "Median", "90 %", "Right floor"), rooms);
  const start = action("Build a radio map", async () => {
    await post("/api/v1/survey/jobs", { site: store.site });
    await ask();
  });
  let shown = "";
  const take = (job) => {
    bar.hidden = job?.state !== "running";
    if (!job) return;
    bar.value = job.share;
    const state = { running: `building: ${job.doing}`, failed: `failed: ${job.doing}`, done: "" }[job.state];
    if (job.state !== "done") {
      said.textContent = state;
      shown = "";
      return;
    }
    if (shown === `${job.site} ${job.id}`) return;
    shown = `${job.site} ${job.id}`;
    const { version, fingerprints, access_points: aps, walks, notes, rooms: found } = job.result;
    said.textContent = `Version ${version}: ${fingerprints} fingerprints of ${aps} access points from ${walks} walks. Publish it below to put it to use.${notes.length ? ` ${notes.join("; ")}.` : ""}${found.length ? " Errors of its fingerprints, each found by the other walks; a place that one walk alone has seen is found elsewhere:" : " Two walks of the same places would tell how accurate it is."}`;
    table.hidden = !found.length;
    const error = (value) => (value === null ? "wrong floor" : metres(value));
    rooms.replaceChildren(...found.map((r) => row(r.level, r.name || "(no room)", r.n, error(r.median), error(r.p90), percent(r.right_floor))));
    built();
  };
  return { element: el("fieldset", {}, el("legend", { textContent: "Build" }), start, bar, said, table), take };
}

/** Versions of the radio map: publish, roll back, upload. */
function startVersions(changed) {
  const rows = el("tbody");
  const file = el("input", { type: "file", accept: ".npz", aria: { label: "A radio map of wayfuse survey build" } });
  const list = async () => {
    const { published, versions } = await get("/api/v1/radio-maps", { site: store.site });
    rows.replaceChildren(...versions.reverse().map((v) => {
      const publish = () => action("Publish", async () => {
        await post("/api/v1/radio-maps/publish", { site: store.site }, { version: v.version });
        await list();
        await changed();
      });
      const made = row(v.version, `${v.note || "no note"}, ${ago(store.now - v.created)}`, "");
      made.lastChild.append(v.version === published ? "in use" : publish());
      return made;
    }));
  };
  const back = action("Roll back", async () => {
    const { published } = await post("/api/v1/radio-maps/roll-back", { site: store.site });
    await list();
    await changed();
    return `version ${published} is in use`;
  });
  const upload = action("Upload", async () => {
    if (!file.files.length) return "Choose a file first.";
    const { version } = await post("/api/v1/radio-maps", { site: store.site, note: file.files[0].name }, file.files[0]);
    file.value = "";
    await list();
    return `version ${version}`;
  });
  const element = el("fieldset", {}, el("legend", { textContent: "Radio map" }),
    el("table", {}, head("Version", "What", ""), rows), el("div", { className: "choices" }, back), file, upload);
  return { element, list };
}

const head = (...names) => el("thead", {}, el("tr", {}, ...names.map((name) => el("th", { textContent: name, scope: "col" }))));
const row = (...cells) => el("tr", {}, ...cells.map((text) => el("td", { textContent: text })));
