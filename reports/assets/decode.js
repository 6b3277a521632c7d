/* Columns from the data block: base64, gzip, bytes by weight, differences. */

async function inflate(text) {
  const packed = atob(text);
  const bytes = new Uint8Array(packed.length);
  for (let i = 0; i < packed.length; i++) bytes[i] = packed.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/* A column as numbers; null where there is no value. */
async function decodeColumn(coded) {
  const { n, decimals, offset } = coded;
  const bytes = await inflate(coded.data);
  const values = new Float64Array(n);
  const scale = 10 ** Math.abs(decimals);
  let tick = 0;
  for (let i = 0; i < n; i++) {
    const word = bytes[i] | (bytes[n + i] << 8) | (bytes[2 * n + i] << 16) | (bytes[3 * n + i] << 24);
    tick = (tick + ((word >>> 1) ^ -(word & 1))) | 0;
    values[i] = decimals >= 0 ? (tick + offset) / scale : (tick + offset) * scale;
  }
  if (coded.gaps === undefined) return values;
  const gaps = await inflate(coded.gaps);
  return Array.from(values, (value, i) => ((gaps[i >> 3] >> (i & 7)) & 1 ? null : value));
}

/* A reader of the data block that decodes each column once. */
function columnReader(block) {
  const decoded = new Map();
  return (column) => {
    if (!decoded.has(column.key)) decoded.set(column.key, decodeColumn(block[column.key]));
    return decoded.get(column.key);
  };
}
