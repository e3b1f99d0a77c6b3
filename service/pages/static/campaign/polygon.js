// Polygons in frame pixels: x right, y down.

/** Twice the area, with its sign, halved and made positive. */
export const areaOf = (points) => Math.abs(points.reduce((sum, [x, y], i) => {
  const [nx, ny] = points[(i + 1) % points.length];
  return sum + x * ny - nx * y;
}, 0)) / 2;

/** Why a polygon cannot be a region, or null: the service checks it again. */
export function faultOf(points) {
  if (points.length < 3) return "Set three corners or more.";
  const edges = points.map((point, i) => [point, points[(i + 1) % points.length]]);
  for (let a = 0; a < edges.length; a += 1) {
    for (let b = a + 1; b < edges.length; b += 1) {
      const neighbours = b === a + 1 || (a === 0 && b === edges.length - 1);
      if (!neighbours && cross(...edges[a], ...edges[b])) return "The edges cross. Move a corner, or undo.";
    }
  }
  if (areaOf(points) === 0) return "The area is zero: all corners lie on one line.";
  return null;
}

export const middle = ([ax, ay], [bx, by]) => [Math.round((ax + bx) / 2), Math.round((ay + by) / 2)];

function cross(a, b, c, d) {
  const side = ([px, py], [qx, qy], [rx, ry]) => Math.sign((qx - px) * (ry - py) - (qy - py) * (rx - px));
  return side(a, b, c) !== side(a, b, d) && side(c, d, a) !== side(c, d, b);
}
