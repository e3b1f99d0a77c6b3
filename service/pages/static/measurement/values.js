// Values of a map: squares over the whole map, and single pixels on request.

import { get } from "../api.js";

const MOST = 120000;
const PIECE = 32;

/** Load the map of a measurement in squares that a screen can show. */
export async function loadMap(measurement, { width_px: width, height_px: height }) {
  const step = Math.max(1, Math.ceil(Math.sqrt((width * height) / MOST)));
  const squares = await get(`/v1/measurements/${measurement.id}/map.json?step=${step}`);
  return new MapValues(measurement.id, squares);
}

export class MapValues {
  constructor(id, { values, step, unit, width_px: width, height_px: height, uncertainty }) {
    Object.assign(this, { id, squares: values, step, unit, width, height, uncertainty, pieces: new Map() });
  }

  /** The mean of the square that a pixel lies in; null where it is unknown. */
  square(row, col) {
    const line = this.squares[Math.min(Math.floor(row / this.step), this.squares.length - 1)];
    return line[Math.min(Math.floor(col / this.step), line.length - 1)];
  }

  /** The very value of a pixel, as in map.tif; asks for the pixels around it too. */
  async pixel(row, col) {
    if (this.step === 1) return this.square(row, col);
    const [top, left] = [row, col].map((place) => Math.floor(place / PIECE) * PIECE);
    const key = `top=${top}&left=${left}`;
    if (!this.pieces.has(key)) {
      const asked = get(`/v1/measurements/${this.id}/map.json?${key}&height=${PIECE}&width=${PIECE}`);
      this.pieces.set(key, asked);
      asked.catch(() => this.pieces.delete(key));
    }
    const { values } = await this.pieces.get(key);
    return values[row - top][col - left];
  }

  /** The standard uncertainty of a pixel's value; undefined where no rule is known. */
  uncertaintyOf(value) {
    if (!this.uncertainty || value === null) return undefined;
    const { u_rel: relative, u_constant: constant, u_pixel: noise } = this.uncertainty;
    return Math.hypot(relative * value, constant, noise);
  }
}
