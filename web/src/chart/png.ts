// The size at which a picture of pixels is printed, written into its file: chunk pHYs of PNG (ISO/IEC 15948).

/** Dots per inch of a printed picture. */
export const PRINT_DPI = 600;

const SIGNATURE_AND_HEADER = 8 + 25;

/** The picture with a note of how many dots an inch has. */
export async function withDensity(picture: Blob, dotsPerInch: number): Promise<Blob> {
  const bytes = new Uint8Array(await picture.arrayBuffer());
  const perMetre = Math.round(dotsPerInch / 0.0254);
  const chunk = new DataView(new ArrayBuffer(21));
  chunk.setUint32(0, 9);
  [..."pHYs"].forEach((letter, i) => {
    chunk.setUint8(4 + i, letter.charCodeAt(0));
  });
  chunk.setUint32(8, perMetre);
  chunk.setUint32(12, perMetre);
  chunk.setUint8(16, 1);
  chunk.setUint32(17, crc32(new Uint8Array(chunk.buffer, 4, 13)));
  const [head, rest] = [bytes.subarray(0, SIGNATURE_AND_HEADER), bytes.subarray(SIGNATURE_AND_HEADER)];
  return new Blob([head, chunk.buffer, rest], { type: "image/png" });
}

/** CRC-32 of PNG, annex D. */
export function crc32(bytes: Uint8Array): number {
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit += 1) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  }
  return (crc ^ 0xffffffff) >>> 0;
}
