// Arrays out of NPZ files: ZIP (stored or deflated) of NPY.
import fs from 'node:fs';
import zlib from 'node:zlib';

const SHAPES = /'shape': \(([^)]*)\)/;
const KINDS = { '<f4': Float32Array, '<i8': BigInt64Array, '<u2': Uint16Array, '<u4': Uint32Array };

/** The array called `name`: its shape and its values. */
export function array(file, name) {
  const bytes = entry(fs.readFileSync(file), `${name}.npy`);
  const version = bytes[6];
  const size = version === 1 ? bytes.readUInt16LE(8) : bytes.readUInt32LE(8);
  const start = (version === 1 ? 10 : 12) + size;
  const head = bytes.toString('latin1', 10, start);
  const kind = KINDS[/'descr': '([^']+)'/.exec(head)[1]];
  const shape = SHAPES.exec(head)[1].split(',').map(Number).filter(Boolean);
  const body = bytes.subarray(start);
  // A copy, so that it begins where its numbers may begin.
  return { shape, values: new kind(new Uint8Array(body).buffer) };
}

/** What an entry of a ZIP holds, by its directory at the end. */
function entry(zip, name) {
  const end = zip.lastIndexOf(Buffer.from('PK\x05\x06', 'latin1'));
  let at = zip.readUInt32LE(end + 16);
  for (let left = zip.readUInt16LE(end + 10); left > 0; left--) {
    const [names, extra, comment] = [28, 30, 32].map((o) => zip.readUInt16LE(at + o));
    if (zip.toString('latin1', at + 46, at + 46 + names) === name) {
      const method = zip.readUInt16LE(at + 10);
      const local = zip.readUInt32LE(at + 42);
      const from = local + 30 + zip.readUInt16LE(local + 26) + zip.readUInt16LE(local + 28);
      const body = zip.subarray(from, from + zip.readUInt32LE(at + 20));
      return method === 0 ? body : zlib.inflateRawSync(body);
    }
    at += 46 + names + extra + comment;
  }
  throw new Error(`no ${name} in the file`);
}
