// The files of a card: zips are opened, headers are read, several at a time.

import { measureCentre, readHeader } from "./headers.js";
import { kindOf } from "./propose.js";

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

/** MS-DOS date and time. */
const dateOf = (stamp) => new Date(((stamp >> 25) & 127) + 1980, ((stamp >> 21) & 15) - 1, (stamp >> 16) & 31, (stamp >> 11) & 31, (stamp >> 5) & 63, (stamp & 31) * 2).getTime();

const viewOf = async (file, from, to) => new DataView(await file.slice(from, to).arrayBuffer());

const AT_ONCE = 8;

/** Rows {key, name, size, kind, file, header, centre, fault} of [{file, name}]; `onProgress(read, of)`, and `signal` stops it. */
export async function readCard(files, { onProgress = () => {}, signal, centres = true }) {
  const entries = (await Promise.all(files.map(openZip))).flat();
  const rows = entries.map((entry) => ({ key: `${entry.name} ${entry.size}`, kind: kindOf(entry.name), ...entry }));
  const readAll = async (kind) => {
    const waiting = rows.filter((row) => row.kind === kind);
    let read = rows.length - waiting.length;
    const readNext = async () => {
      for (let row = waiting.pop(); row && !signal?.aborted; row = waiting.pop()) {
        await readRow(row, centres);
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

async function readRow(row, centres) {
  try {
    row.file ??= await row.open();
    row.header = await readHeader(row.file);
    row.centre = row.header && centres ? await measureCentre(row.file, row.header) : undefined;
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
