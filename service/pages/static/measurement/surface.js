// A rectangle on the ground in the image of a camera, with its cells.

/**
 * From the unit square to its image: (u, v) to [x, y].
 * Corners: top-left, top-right, bottom-right, bottom-left (P. Heckbert, Fundamentals of texture mapping, 1989).
 */
function projection([[x0, y0], [x1, y1], [x2, y2], [x3, y3]]) {
  const [sx, sy] = [x0 - x1 + x2 - x3, y0 - y1 + y2 - y3];
  const [dx1, dx2, dy1, dy2] = [x1 - x2, x3 - x2, y1 - y2, y3 - y2];
  const whole = dx1 * dy2 - dx2 * dy1;
  const g = (sx * dy2 - dx2 * sy) / whole;
  const k = (dx1 * sy - sx * dy1) / whole;
  const [a, b, d, e] = [x1 - x0 + g * x1, x3 - x0 + k * x3, y1 - y0 + g * y1, y3 - y0 + k * y3];
  return (u, v) => {
    const w = g * u + k * v + 1;
    return [(a * u + b * v + x0) / w, (d * u + e * v + y0) / w];
  };
}

/** The field of lanes as a grid, as EN 13201-3 divides it: three rows a lane; `length`: of the rectangle with these corners [m]. */
export function laneGrid(corners, { lanes, spacing, length }) {
  const at = projection(corners);
  const share = spacing / length;
  return { corners: [corners[0], at(share, 0), at(share, 1), corners[3]], rows: 3 * lanes, columns: Math.max(10, Math.ceil(spacing / 3 - 1e-9)) };
}

/** The lines between the cells of a grid, each from one point to another. */
export function cellLines({ corners, rows, columns }) {
  const at = projection(corners);
  const lines = [[corners[1], corners[2]]];
  for (let row = 1; row < rows; row += 1) lines.push([at(0, row / rows), at(1, row / rows)]);
  for (let column = 1; column < columns; column += 1) lines.push([at(column / columns, 0), at(column / columns, 1)]);
  return lines;
}
