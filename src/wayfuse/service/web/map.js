// The map: MapLibre GL on the floors of one site. Knows frames and GeoJSON, nothing of the server.

import { EMPTY } from "/web/frames.js";
import { RASTER_BELOW, recolour, style } from "/web/layers.js";
import { onTheme, palette } from "/web/theme.js";

const ASSETS = "/web/assets";

export class NotBuilt extends Error {}

export class IndoorMap {
  /** The map in an element, when it is ready to draw. Throws NotBuilt where the map library is not there. */
  static async in(container) {
    let library;
    try {
      library = await import(`${ASSETS}/maplibre-gl.mjs`);
    } catch {
      throw new NotBuilt("The map is not built yet. In a source checkout: make web. Elsewhere: python -m wayfuse.service.web.build (it needs npm).");
    }
    library.setWorkerUrl(`${ASSETS}/maplibre-gl-worker.mjs`);
    const map = new library.Map({
      container,
      style: style(palette()),
      center: [0, 0],
      zoom: 16,
      minZoom: 13,
      maxZoom: 24,
      attributionControl: false,
      dragRotate: false,
      pitchWithRotate: false,
      touchPitch: false,
      renderWorldCopies: false,
      fadeDuration: 0,
      canvasContextAttributes: { antialias: true },
    });
    map.touchZoomRotate.disableRotation();
    map.keyboard.disableRotation();
    map.addControl(new library.NavigationControl({ showCompass: false }), "bottom-right");
    map.addControl(new library.ScaleControl({ unit: "metric" }), "bottom-left");
    await new Promise((done) => map.once("load", done));
    return new IndoorMap(map, container);
  }

  constructor(map, container) {
    this.map = map;
    this.pressed = null;
    container.map = map; // for people's own scripts, and tests
    onTheme(() => recolour(map, palette()));
    map.on("click", (event) => this.#click(event));
    map.on("mousemove", (event) => {
      map.getCanvas().style.cursor = this.pressed ? "crosshair" : this.#dotAt(event.point) ? "pointer" : "";
    });
    this.onDot = () => {};
  }

  /** Call `work(lon, lat)` with the next presses on the map; null: presses choose tracks again. */
  onPress(work) {
    this.pressed = work;
    this.map.getCanvas().style.cursor = work ? "crosshair" : "";
  }

  #dotAt(point) {
    const box = [[point.x - 8, point.y - 8], [point.x + 8, point.y + 8]];
    return this.map.queryRenderedFeatures(box, { layers: ["dots"] })[0];
  }

  #click(event) {
    if (this.pressed) {
      this.pressed(event.lngLat.lng, event.lngLat.lat);
      return;
    }
    const dot = this.#dotAt(event.point);
    this.onDot(dot ? dot.properties.track : "");
  }

  data(source, collection) {
    this.map.getSource(source).setData(collection ?? EMPTY);
  }

  fit(bounds, animate = false) {
    this.map.fitBounds(bounds, { padding: 32, animate, maxZoom: 21 });
  }

  /** Keep a place in view: moves only where it would leave the middle of the map. */
  follow([lon, lat]) {
    const at = this.map.project([lon, lat]);
    const { clientWidth: width, clientHeight: height } = this.map.getContainer();
    const inside = at.x > 0.12 * width && at.x < 0.88 * width && at.y > 0.12 * height && at.y < 0.88 * height;
    if (!inside) this.map.easeTo({ center: [lon, lat], duration: 400 });
  }

  goTo([lon, lat]) {
    this.map.easeTo({ center: [lon, lat], zoom: Math.max(this.map.getZoom(), 19), duration: 400 });
  }

  /** A canvas over the floor, its corners clockwise from the north-west; null takes it away. */
  raster(canvas, corners) {
    if (this.map.getLayer("raster")) this.map.removeLayer("raster");
    if (this.map.getSource("raster")) this.map.removeSource("raster");
    if (!canvas) return;
    this.map.addSource("raster", { type: "canvas", canvas, animate: false, coordinates: corners });
    const paint = { "raster-opacity": 0.8, "raster-resampling": "nearest", "raster-fade-duration": 0 };
    this.map.addLayer({ id: "raster", type: "raster", source: "raster", paint }, RASTER_BELOW);
  }
}
