// The files of a card: zips are opened, and headers are read, several at a time.

import { kindOf } from "./propose.js";

const FIRST = 256 << 10;
const MORE = 64 << 10;
const MOST_DIRECTORIES = 16;
const MOST_SEGMENTS = 64;
const [START, EXIF_SEGMENT, SCAN] = [0xd8, 0xe1, 0xda]; // of a JPEG
const ROWS = 8; // of the centre, measured
const SIZES = { 1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4 };
const [SUB_IFDS, EXIF, XMP, GPS] = [330, 34665, 700, 34853];
const DATA = [[273, 279], [324, 325]]; // strips and tiles: where each begins, and its length
const ISO_TAGS = [34855, 34866, 34867, 34865];
const ASK_ELSEWHERE = 65535; // EXIF 2.3: the ISO does not fit, another tag states it
const CFA = 32803;

/**
 * {make, model, serial, lens, band, taken (ms; a local time is read as UTC), zoned, place [latitude, longitude], aim (pitch and yaw of a
 * gimbal), exposure_time_s, f_number, iso, image, preview, cut (bytes that its tables name and the file lacks)} of a TIFF, DNG or JPEG with EXIF; null for another file. What the file does not state is undefined.
 */
export async function readHeader(file) {
  const bytes = new Bytes(file);
  if ((await bytes.number(0, 1)) === 0xff && (await bytes.number(1, 1)) === START) return readJpeg(file, bytes);
  const order = await bytes.text(0, 2);
  if (order !== "II" && order !== "MM") return null;
  bytes.little = order === "II";
  if ((await bytes.number(2, 3)) !== 42) return null;
  const main = await readDirectory(bytes, await bytes.number(4, 4));
  const [exif] = await Promise.all((await main.numbers(EXIF)).slice(0, 1).map((at) => readDirectory(bytes, at)));
  const found = [exif, main].filter(Boolean);
  const text = async (...tags) => {
    for (const tag of tags) for (const directory of found) {
      const stated = await directory.text(tag);
      if (stated) return stated;
    }
    return undefined;
  };
  const numbers = async (tag) => {
    for (const directory of found) {
      const stated = await directory.numbers(tag);
      if (stated.length) return stated;
    }
    return [];
  };
  const positive = async (...tags) => {
    for (const tag of tags) for (const value of await numbers(tag)) if (value > 0 && Number.isFinite(value) && value !== ASK_ELSEWHERE) return value;
    return undefined;
  };
  const apex = async (tag, factor) => {
    const [value] = await numbers(tag);
    return value && Math.abs(value) <= 64 ? 2 ** (factor * value) : undefined;
  };
  const xmp = (await main.text(XMP, 1 << 16)) ?? "";
  return {
    make: await text(271),
    model: await text(272, 50708),
    // DJI's multispectral cameras name the imager in XMP alone
    serial: (await text(50735, 42033)) ?? packetText(xmp, "CameraSerialNumber"),
    lens: { make: await text(42035), model: await text(42036), serial: await text(42037) },
    band: packetText(xmp, "BandName"),
    place: await placeOf(bytes, main),
    aim: ["Pitch", "Yaw"].map((axis) => Number.parseFloat(packetText(xmp, `Gimbal${axis}Degree`))),
    ...timeOf(await text(36867), await text(37521), await text(36881)),
    exposure_time_s: (await positive(33434)) ?? (await apex(37377, -1)),
    f_number: (await positive(33437)) ?? (await apex(37378, 0.5)),
    iso: await positive(...ISO_TAGS),
    ...(await picturesOf(bytes, main)),
  };
}

/** The EXIF of a JPEG is a TIFF in one of its segments. */
async function readJpeg(file, bytes) {
  bytes.little = false;
  for (let at = 2, count = 0; count < MOST_SEGMENTS; count += 1) {
    const [mark, kind, size] = [await bytes.number(at, 1), await bytes.number(at + 1, 1), await bytes.number(at + 2, 3)];
    if (mark !== 0xff || kind === SCAN) return null;
    if (kind === EXIF_SEGMENT && (await bytes.text(at + 4, 6)) === "Exif\0\0") {
      const header = await readHeader(file.slice(at + 10, at + 2 + size));
      return header && { ...header, image: undefined, preview: { at: 0, size: file.size } };
    }
    at += 2 + size;
  }
  return null;
}

/** The numbers themselves, where a file has one strip of 16-bit words, and an embedded JPEG preview. */
async function picturesOf(bytes, main) {
  const parts = [main];
  for (const at of (await main.numbers(SUB_IFDS)).slice(0, MOST_DIRECTORIES)) parts.push(await readDirectory(bytes, at));
  const found = { cut: 0 };
  for (const part of parts) {
    for (const [begins, lengths] of DATA) {
      const [at, size] = [await part.numbers(begins), await part.numbers(lengths)];
      found.cut = at.reduce((most, each, index) => Math.max(most, each + (size[index] ?? 0) - bytes.file.size), found.cut);
    }
    const one = async (tag, usual) => (await part.numbers(tag))[0] ?? usual;
    const [width, height, bits, compression, kind, strips, sizes] = [await one(256), await one(257), await one(258, 1), await one(259, 1), await one(262), await part.numbers(273), await part.numbers(279)];
    if (compression === 1 && bits === 16 && (kind === CFA || kind === 1) && strips.length && (await one(277, 1)) === 1) {
      const rows = await one(278, height);
      found.image = { width, height, rows, strips, cfa: kind === CFA, black: await one(50714, 0), white: await one(50717, 65535), little: bytes.little };
    } else if ([6, 7].includes(compression) && kind === 6 && strips.length === 1 && !(found.preview?.size < sizes[0])) found.preview = { at: strips[0], size: sizes[0] };
  }
  return found;
}

async function placeOf(bytes, main) {
  const [at] = await main.numbers(GPS);
  const gps = at && (await readDirectory(bytes, at));
  const degrees = async (tag, below) => (await gps.numbers(tag + 1)).reduce((sum, each, power) => sum + each / 60 ** power, 0) * ((await gps.text(tag)) === below ? -1 : 1);
  const place = gps && [await degrees(1, "S"), await degrees(3, "W")];
  return place?.every(Number.isFinite) && place.some(Boolean) ? place : undefined;
}

async function readDirectory(bytes, at) {
  const count = await bytes.number(at, 3);
  if (count > 1000) throw new Error("This is not a TIFF directory.");
  const entries = new Map();
  for (let index = 0; index < count; index += 1) {
    const entry = at + 2 + 12 * index;
    const [type, length] = [await bytes.number(entry + 2, 3), await bytes.number(entry + 4, 4)];
    const size = (SIZES[type] ?? 0) * length;
    if (size) entries.set(await bytes.number(entry, 3), { type, length, at: size <= 4 ? entry + 8 : await bytes.number(entry + 8, 4) });
  }
  return {
    async numbers(tag) {
      const { type, length, at: place } = entries.get(tag) ?? {};
      if (!type || type === 2 || type === 7 || length > 1 << 16) return [];
      const values = [];
      for (let index = 0; index < length; index += 1) values.push(await bytes.number(place + index * SIZES[type], type));
      return values;
    },
    async text(tag, most = 4096) {
      const { type, length, at: place } = entries.get(tag) ?? {};
      if (![1, 2, 7].includes(type)) return undefined;
      const [said] = (await bytes.text(place, Math.min(length, most))).split("\0");
      // eslint-disable-next-line no-control-regex
      return said.replace(/[\u0000-\u001f\u007f]/g, " ").trim() || undefined;
    },
  };
}

class Bytes {
  constructor(file) {
    Object.assign(this, { file, pieces: [], little: true });
  }

  async view(at, size) {
    if (at + size > this.file.size) throw new Error("The file ends before its header does.");
    let piece = this.pieces.find((each) => at >= each.at && at + size <= each.at + each.view.byteLength);
    if (!piece) {
      const length = Math.max(size, this.pieces.length ? MORE : FIRST);
      piece = { at, view: new DataView(await this.file.slice(at, at + length).arrayBuffer()) };
      this.pieces.push(piece);
    }
    return [piece.view, at - piece.at];
  }

  async text(at, size) {
    const [view, place] = await this.view(at, size);
    return new TextDecoder().decode(new Uint8Array(view.buffer, place, size));
  }

  async number(at, type) {
    const [view, place] = await this.view(at, SIZES[type]);
    const le = this.little;
    if (type === 5) return view.getUint32(place, le) / view.getUint32(place + 4, le);
    if (type === 10) return view.getInt32(place, le) / view.getInt32(place + 4, le);
    const name = { 1: "Uint8", 3: "Uint16", 4: "Uint32", 6: "Int8", 8: "Int16", 9: "Int32", 11: "Float32", 12: "Float64", 13: "Uint32" }[type];
    return view[`get${name}`](place, le);
  }
}

function timeOf(said, fraction, offset) {
  const found = /^(\d{4}):(\d\d):(\d\d) (\d\d:\d\d:\d\d)/.exec(said ?? "");
  if (!found) return {};
  const [, year, month, date, clock] = found;
  const zone = /^([+-]\d\d:\d\d|Z)$/.test(offset ?? "") ? offset : "Z";
  const taken = Date.parse(`${year}-${month}-${date}T${clock}.${/^\d{1,9}$/.test(fraction ?? "") ? fraction.padEnd(3, "0").slice(0, 3) : "000"}${zone}`);
  return Number.isNaN(taken) ? {} : { taken, zoned: zone === offset };
}

const packetText = (xmp, name) => (new RegExp(`:${name}="([^"]+)"|:${name}>\\s*(?:<rdf:(?:Seq|Bag|Alt)>\\s*<rdf:li[^>]*>)?([^<]+)<`).exec(xmp) ?? []).slice(1).find(Boolean)?.trim() || undefined;

/** Means over the centre (a ninth of the frame): {signal, clipped} as shares of the way from black to white; of a preview, undefined. */
async function measureCentre(file, { image }) {
  if (!image) return undefined;
  const { width, height, black, white } = image;
  let [sum, clipped, count] = [0, 0, 0];
  for (let step = 0; step < ROWS; step += 1) {
    const row = Math.floor(height / 3 + (height / 3) * (step / ROWS));
    for (const value of (await readRow(file, image, row)).subarray(Math.floor(width / 3), Math.ceil((2 * width) / 3))) {
      sum += value;
      clipped += value >= white;
      count += 1;
    }
  }
  return { signal: (sum / count - black) / (white - black), clipped: clipped / count };
}

export async function readRow(file, { width, rows, strips, little }, row) {
  const at = strips[Math.floor(row / rows)] + (row % rows) * width * 2;
  const view = new DataView(await file.slice(at, at + width * 2).arrayBuffer());
  return Uint16Array.from({ length: view.byteLength >> 1 }, (_, index) => view.getUint16(index * 2, little));
}

const [END, END64, LOCATOR64, ENTRY] = [0x06054b50, 0x06064b50, 0x07064b50, 0x02014b50];
const TAIL = 22 + 65535;

/** [{name, size, open()}] of a zip (also ZIP64); `open` answers a File. Throws for what is none. */
async function listZip(zip) {
  const tail = await viewOf(zip, Math.max(0, zip.size - TAIL), zip.size);
  let end = tail.byteLength - 22;
  while (end >= 0 && tail.getUint32(end, true) !== END) end -= 1;
  if (end < 0) throw new Error("This zip has no list of its files: it is damaged or incomplete.");
  let [size, at] = [tail.getUint32(end + 12, true), tail.getUint32(end + 16, true)];
  if (end >= 20 && tail.getUint32(end - 20, true) === LOCATOR64) {
    const place = Number(tail.getBigUint64(end - 12, true));
    const wide = await viewOf(zip, place, place + 56);
    if (wide.getUint32(0, true) !== END64) throw new Error("This zip is damaged.");
    [size, at] = [Number(wide.getBigUint64(40, true)), Number(wide.getBigUint64(48, true))];
  }
  const list = await viewOf(zip, at, at + size);
  const found = [];
  for (let place = 0; place + 46 <= list.byteLength && list.getUint32(place, true) === ENTRY; ) {
    const [nameLength, extraLength, noteLength] = [28, 30, 32].map((offset) => list.getUint16(place + offset, true));
    const path = new TextDecoder().decode(new Uint8Array(list.buffer, list.byteOffset + place + 46, nameLength)).replaceAll("\\", "/");
    const parts = path.split("/").filter((part) => !["", ".", ".."].includes(part));
    const name = parts.join("/");
    const entry = { name, method: list.getUint16(place + 10, true), locked: (list.getUint16(place + 8, true) & 1) === 1, modified: dateOf(list.getUint32(place + 12, true)), packed: list.getUint32(place + 20, true), size: list.getUint32(place + 24, true), at: list.getUint32(place + 42, true) };
    widen(entry, list, place + 46 + nameLength, extraLength);
    if (!path.endsWith("/") && !parts.some((part) => part.startsWith(".") || part === "__MACOSX")) found.push({ name, size: entry.size, open: () => unpack(zip, entry) });
    place += 46 + nameLength + extraLength + noteLength;
  }
  return found;
}

/** Sizes above 4 GB stand in an extra field. */
function widen(entry, list, from, length) {
  for (let at = from; at + 4 <= from + length; at += 4 + list.getUint16(at + 2, true)) {
    if (list.getUint16(at, true) !== 1) continue;
    let place = at + 4;
    for (const name of ["size", "packed", "at"]) if (entry[name] === 0xffffffff) (entry[name] = Number(list.getBigUint64(place, true))), (place += 8);
  }
}

async function unpack(zip, { name, method, locked, modified, packed, size, at }) {
  if (locked || ![0, 8].includes(method)) throw new Error(`The zip ${locked ? "is encrypted" : "uses another compression than deflate"}: unpack it and drop its folder.`);
  const head = await viewOf(zip, at, at + 30);
  const from = at + 30 + head.getUint16(26, true) + head.getUint16(28, true);
  const body = zip.slice(from, from + packed);
  const content = method === 0 ? body : await new Response(body.stream().pipeThrough(new DecompressionStream("deflate-raw"))).blob();
  if (content.size !== size) throw new Error("The file is damaged in the zip.");
  return new File([content], name.split("/").at(-1), { lastModified: modified });
}

const dateOf = (stamp) => new Date(((stamp >> 25) & 127) + 1980, ((stamp >> 21) & 15) - 1, (stamp >> 16) & 31, (stamp >> 11) & 31, (stamp >> 5) & 63, (stamp & 31) * 2).getTime();

const viewOf = async (file, from, to) => new DataView(await file.slice(from, to).arrayBuffer());

const AT_ONCE = 8;

/** Rows {key, name, size, kind, file, header, centre, fault} of [{file, name}]; `onProgress(read, of)`, and `signal` stops it. */
export async function readCard(files, { onProgress = () => {}, signal } = {}) {
  const entries = (await Promise.all(files.map(openZip))).flat();
  const rows = entries.map((entry) => ({ key: `${entry.name} ${entry.size}`, kind: kindOf(entry.name), ...entry }));
  const readAll = async (kind) => {
    const waiting = rows.filter((row) => row.kind === kind);
    let read = rows.length - waiting.length;
    const readNext = async () => {
      for (let row = waiting.pop(); row && !signal?.aborted; row = waiting.pop()) {
        await readOne(row);
        onProgress((read += 1), rows.length);
      }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, readNext));
    signal?.throwIfAborted();
  };
  await readAll("raw");
  // without raw frames, pictures may be of a chart
  if (!rows.some((row) => row.kind === "raw" && row.header)) await readAll("picture");
  return rows;
}

async function readOne(row) {
  try {
    row.file ??= await row.open();
    row.header = await readHeader(row.file);
    row.centre = row.header && (await measureCentre(row.file, row.header));
  } catch (error) {
    // what has no header that can be read is listed as skipped, with the reason
    row.fault = error.message;
  }
}

async function openZip({ file, name }) {
  if (!/\.zip$/i.test(name)) return [{ file, name, size: file.size }];
  try {
    const above = name.replace(/\.zip$/i, "");
    return (await listZip(file)).map((entry) => ({ ...entry, name: `${above}/${entry.name}` }));
  } catch (error) {
    return [{ name, size: file.size, fault: error.message }];
  }
}
