// Rectangles and roads on the ground in the image of a camera: homographies, the lens, and the lines of a grid.

/** The map from (u, v) to [x, y] that a homography of three rows describes. */
const through = (h) => ([u, v]) => {
  const [x, y, w] = h.map(([a, b, c]) => a * u + b * v + c);
  return [x / w, y / w];
};

const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];

function invert([first, second, third]) {
  const columns = [cross(second, third), cross(third, first), cross(first, second)];
  return [0, 1, 2].map((row) => columns.map((column) => column[row]));
}

/**
 * From the unit square to its image.
 * Corners: top-left, top-right, bottom-right, bottom-left (P. Heckbert, Fundamentals of texture mapping, 1989).
 */
function projection([[x0, y0], [x1, y1], [x2, y2], [x3, y3]]) {
  const [sx, sy] = [x0 - x1 + x2 - x3, y0 - y1 + y2 - y3];
  const [dx1, dx2, dy1, dy2] = [x1 - x2, x3 - x2, y1 - y2, y3 - y2];
  const whole = dx1 * dy2 - dx2 * dy1;
  const g = (sx * dy2 - dx2 * sy) / whole;
  const k = (dx1 * sy - sx * dy1) / whole;
  return through([[x1 - x0 + g * x1, x3 - x0 + k * x3, x0], [y1 - y0 + g * y1, y3 - y0 + k * y3, y0], [g, k, 1]]);
}

const TURNS = 30;

/** Between the road [m] and a picture of it [px], by a placement as the service answers it: the lens bends as OpenCV's model says. */
export function placed({ h, matrix: [[fx, , cx], [, fy, cy]], distortion: [k1, k2, p1, p2, k3] }) {
  const [forth, back] = [through(h), through(invert(h))];
  const bend = ([x, y]) => {
    const r = x * x + y * y;
    const radial = 1 + r * (k1 + r * (k2 + r * k3));
    return [x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x), y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y];
  };
  return {
    toImage(place) {
      const [x, y] = bend(forth(place));
      return [fx * x + cx + 0.5, fy * y + cy + 0.5];
    },
    toRoad([x, y]) {
      const seen = [(x - 0.5 - cx) / fx, (y - 0.5 - cy) / fy];
      let ray = seen;
      for (let turn = 0; turn < TURNS; turn += 1) {
        const bent = bend(ray);
        ray = ray.map((each, axis) => each + seen[axis] - bent[axis]);
      }
      return back(ray);
    },
  };
}

/** What lanes between two luminaires are stated by, as the API names it: [name, label, value]. */
export const LANES = [["lanes", "Lanes", 2], ["lane_width_m", "Lane width [m]", 3.5], ["spacing_m", "Spacing of luminaires [m]", 30]];

/** The field of lanes as a grid, as EN 13201-3 divides it: three rows a lane; `length`: of the rectangle with these corners [m]. */
export function laneGrid(corners, { lanes, spacing, length }) {
  const at = projection(corners);
  const share = spacing / length;
  return { corners: [corners[0], at([share, 0]), at([share, 1]), corners[3]], rows: 3 * lanes, columns: Math.max(10, Math.ceil(spacing / 3 - 1e-9)) };
}

export function cellLines({ corners, rows, columns }) {
  const at = projection(corners);
  const lines = [[corners[1], corners[2]]];
  for (let row = 1; row < rows; row += 1) lines.push([at([0, row / rows]), at([1, row / rows])]);
  for (let column = 1; column < columns; column += 1) lines.push([at([column / columns, 0]), at([column / columns, 1])]);
  return lines;
}
