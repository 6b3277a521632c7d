// Read an MCAP file with @mcap/core and print what is in it as JSON.
// node tests/js/read_mcap.mjs FILE   (Node >= 22.15: zstd is in node:zlib from there on)
import { open } from "node:fs/promises";
import { zstdDecompressSync } from "node:zlib";
import { McapIndexedReader } from "@mcap/core";

const file = await open(process.argv[2], "r");
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const buffer = new Uint8Array(Number(length));
    const { bytesRead } = await file.read(buffer, 0, buffer.length, Number(offset));
    return buffer.subarray(0, bytesRead);
  },
};
const decompressHandlers = { zstd: (data, size) => zstdDecompressSync(data, { maxOutputLength: Number(size) }) };

const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const topics = {};
for await (const message of reader.readMessages()) {
  const { topic } = reader.channelsById.get(message.channelId);
  const seen = (topics[topic] ??= { count: 0, bytes: 0, first_log_time_ns: String(message.logTime) });
  seen.count += 1;
  seen.bytes += message.data.byteLength;
  seen.last_log_time_ns = String(message.logTime);
}
const attachments = [];
for await (const attachment of reader.readAttachments()) {
  attachments.push({ name: attachment.name, media_type: attachment.mediaType, bytes: attachment.data.byteLength });
}
const metadata = {};
for await (const record of reader.readMetadata()) {
  metadata[record.name] = Object.fromEntries(record.metadata);
}
const schemas = [...reader.schemasById.values()].map(({ name, encoding }) => ({ name, encoding }));
await file.close();
console.log(JSON.stringify({ profile: reader.header.profile, topics, schemas, attachments, metadata }));
