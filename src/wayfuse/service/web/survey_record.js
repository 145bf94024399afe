// Recording by hand: a phone pushes its scans, a person presses on the map where it stands or turns.

import { post } from "/web/api.js";
import { action, ago, el } from "/web/dom.js";
import { store } from "/web/store.js";

const HERE_S = 20; // a phone heard within this pushes now

/** changed(): the survey has one walk more. draw(taps): show taps that are not sent yet. */
export function startRecord(map, changed, draw) {
  const phone = el("select", { id: "survey-phone" });
  const said = el("p", { className: "small", role: "status" });
  const stand = el("button", { type: "button", textContent: "Stand here" });
  const walk = el("button", { type: "button", textContent: "Walk" });
  const done = el("button", { type: "button", textContent: "Finish", className: "main", hidden: true });
  const drop = el("button", { type: "button", textContent: "Discard", hidden: true });
  const element = el("fieldset", {}, el("legend", { textContent: "Record" }),
    el("label", { htmlFor: "survey-phone", textContent: "Phone that pushes scans" }), phone,
    el("div", { className: "choices" }, stand, walk, done, drop), said, makeAddress());
  let taps = [];
  let mode = "";
  let first = 0; // scans of the phone when the recording began
  let phones = [];

  const scans = () => (phones.find((p) => p.device === phone.value)?.scans ?? 0) - first;
  const at = (lon, lat) => {
    const [x, y] = store.floors[store.floor].frame.metres(lon, lat);
    return { t: Date.now() / 1000, floor: store.floor, x: Math.round(100 * x) / 100, y: Math.round(100 * y) / 100 };
  };
  const begin = (how) => {
    mode = how;
    taps = [];
    stand.hidden = walk.hidden = true;
    drop.hidden = false;
    map.onPress((lon, lat) => {
      if (mode === "stand" && taps.length) return;
      if (!taps.length) first += scans();
      taps.push(at(lon, lat));
      draw(taps);
      done.hidden = mode === "walk" && taps.length < 2;
      say();
    });
    say();
  };
  const end = () => {
    mode = "";
    taps = [];
    stand.hidden = walk.hidden = false;
    done.hidden = drop.hidden = true;
    map.onPress(null);
    draw(taps);
  };
  const say = () => {
    if (!mode) return;
    const since = taps.length ? Math.round(Date.now() / 1000 - taps[0].t) : 0;
    const so = `${since} s, ${scans()} scans so far.`;
    if (!taps.length) said.textContent = mode === "stand" ? "Stand still, and press on the map where you are." : "Press on the map where you are, then walk.";
    else if (mode === "stand") said.textContent = `Stand still: ${so} Ten seconds and three scans are a good fingerprint.`;
    else said.textContent = `Walk straight and evenly; press at every turn, and where you stop: ${so}`;
  };
  stand.addEventListener("click", () => begin("stand"));
  walk.addEventListener("click", () => begin("walk"));
  drop.addEventListener("click", () => {
    end();
    said.textContent = "Discarded.";
  });
  done.addEventListener("click", async () => {
    const kept = mode === "stand" ? [taps[0], { ...taps[0], t: Date.now() / 1000 }] : taps;
    const n = scans();
    try {
      await post("/api/v1/survey/walks", { site: store.site }, { device: phone.value, now: Date.now() / 1000, taps: kept });
      end();
      said.textContent = n ? `Kept, with ${n} scans.` : "Kept, but the phone has pushed no scan meanwhile: is it scanning?";
      await changed();
    } catch (error) {
      said.textContent = error.message;
    }
  });
  setInterval(say, 1000);

  /** Take what the server said of the survey. */
  const take = (survey) => {
    phones = survey.phones;
    const kept = phone.value;
    const rows = phones.map((p) => el("option", { value: p.device, textContent:
      `${p.device.slice(0, 6)}: ${p.scans} scans, ${survey.now - p.heard < HERE_S ? "pushing" : `last ${ago(survey.now - p.heard)}`}` }));
    phone.replaceChildren(...(rows.length ? rows : [el("option", { value: "", textContent: "None yet: give one the address below" })]));
    if (phones.some((p) => p.device === kept)) phone.value = kept;
    stand.disabled = walk.disabled = !phones.length;
    say();
  };
  return { element, take, left: () => { end(); said.textContent = ""; } };
}

/** The address that a phone's app pushes to, with a token that may do nothing else. */
function makeAddress() {
  const platform = el("select", { aria: { label: "Kind of phone" } }, el("option", { value: "android", textContent: "Android" }), el("option", { value: "ios", textContent: "iPhone" }));
  const purpose = el("select", { id: "push-purpose", aria: { label: "What for" } }, el("option", { value: "/survey", textContent: "to survey" }), el("option", { value: "", textContent: "to be tracked alone" }));
  const address = el("input", { type: "text", readOnly: true, hidden: true, id: "push-address", aria: { label: "Push address" } });
  const make = action("Make a push address", async () => {
    const { token } = await post("/api/v1/tokens", {}, { scopes: ["ingest"], label: `phone, ${platform.value}`, site: store.site });
    address.value = `${location.origin}/in/${token}${purpose.value}/sensor-logger?platform=${platform.value}`;
    address.hidden = false;
    address.focus();
    address.select();
    const isLocal = ["127.0.0.1", "localhost", "[::1]"].includes(location.hostname);
    return isLocal ? "Phones cannot reach this address: start the server with --host 0.0.0.0 and open the page by this machine's name." : "Paste it into Sensor Logger: Settings, Data Streaming, HTTP Push.";
  });
  return el("details", {}, el("summary", { textContent: "Connect a phone (Sensor Logger)" }), el("div", { className: "choices" }, platform, purpose, make), address);
}
