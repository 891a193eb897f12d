// What loaders expect of a browser, and files read from the disk. Pictures are looked at as far as their size.
import fs from "node:fs";
import path from "node:path";

globalThis.self = globalThis;
globalThis.ProgressEvent ??= class extends Event {};
globalThis.createImageBitmap = async (blob) => {
  const bytes = Buffer.from(await blob.arrayBuffer());
  if (bytes.toString("latin1", 1, 4) !== "PNG") throw new Error("a picture is no PNG");
  return { width: bytes.readUInt32BE(16), height: bytes.readUInt32BE(20), close() {} };
};

export const read = (file) => fs.readFileSync(file);

// A file that an asset names, by its address, as an address that needs no disk.
export function beside(asset, address) {
  if (/^(data|blob):/.test(address)) return address;
  const bytes = read(path.join(path.dirname(asset), decodeURIComponent(address)));
  return `data:application/octet-stream;base64,${bytes.toString("base64")}`;
}

// { names: [J], T_posed_rest: [P J 4 4] } as rows.
export const readPoses = (file) => JSON.parse(read(file));
