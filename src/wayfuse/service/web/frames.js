// Floors and their frames: metres of a floor to longitude and latitude and back (the server's GeoAnchor, an affine map).

export class Frame {
  constructor({ origin, matrix, width_m: width, height_m: height }) {
    Object.assign(this, { origin, matrix, width, height });
    const [[a, b], [c, d]] = matrix;
    const det = a * d - b * c;
    this.inverse = [[d / det, -b / det], [-c / det, a / det]];
  }

  /** Longitude and latitude of a place in metres. */
  degrees(x, y) {
    const [[a, b], [c, d]] = this.matrix;
    return [this.origin[0] + a * x + b * y, this.origin[1] + c * x + d * y];
  }

  /** The place in metres of a longitude and latitude. */
  metres(lon, lat) {
    const [[a, b], [c, d]] = this.inverse;
    const [u, v] = [lon - this.origin[0], lat - this.origin[1]];
    return [a * u + b * v, c * u + d * v];
  }

  /** West-south and east-north corners of the floor. */
  get bounds() {
    const corners = [[0, 0], [this.width, 0], [0, this.height], [this.width, this.height]].map(([x, y]) => this.degrees(x, y));
    const [lon, lat] = [0, 1].map((k) => corners.map((corner) => corner[k]));
    return [[Math.min(...lon), Math.min(...lat)], [Math.max(...lon), Math.max(...lat)]];
  }

  /** A circle of so many metres as a polygon. */
  circle(x, y, radius, corners = 48) {
    const ring = Array.from({ length: corners + 1 }, (_, k) => {
      const angle = (2 * Math.PI * k) / corners;
      return this.degrees(x + radius * Math.cos(angle), y + radius * Math.sin(angle));
    });
    return { type: "Polygon", coordinates: [ring] };
  }

  point(x, y) {
    return { type: "Point", coordinates: this.degrees(x, y) };
  }
}

export const feature = (geometry, properties = {}) => ({ type: "Feature", geometry, properties });
export const collection = (features) => ({ type: "FeatureCollection", features });
export const EMPTY = collection([]);
