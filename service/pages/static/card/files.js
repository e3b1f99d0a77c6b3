// The files of a card: zips are opened, headers are read, several at a time.

import { kindOf } from "./propose.js";
import { measureCentre, readHeader } from "./headers.js";
import { listZip } from "./zip.js";

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
