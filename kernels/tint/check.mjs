// Gives every WGSL text of a folder to Tint, the compiler of Dawn and Chromium, and prints what it refuses, with file
// and line. Dawn's null backend compiles no further, so no GPU is needed.
//
//     node check.mjs FOLDER
//
// Tint proves that barriers are reached by a whole workgroup or not at all; no text may switch that off.
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { create } from 'webgpu';

const folder = process.argv[2];
const names = readdirSync(folder).filter((name) => name.endsWith('.wgsl')).sort();
// Must outlive its adapters and devices, which crash once it is collected.
const gpu = create(['backend=null']);
const adapter = await gpu.requestAdapter();
if (!adapter) {
  throw new Error("Dawn's null backend gives no adapter");
}
const device = await adapter.requestDevice({ requiredFeatures: ['subgroups'] });
let refused = 0;
for (const name of names) {
  device.pushErrorScope('validation');
  const module = device.createShaderModule({ label: name, code: readFileSync(join(folder, name), 'utf8') });
  const { messages } = await module.getCompilationInfo();
  const error = await device.popErrorScope();
  // Notes give the origin of an error; warnings count as errors.
  for (const { type, lineNum, linePos, message } of messages) {
    console.log(`${name}:${lineNum}:${linePos}: ${type}: ${message}`);
  }
  if (error && messages.length === 0) {
    console.log(`${name}: ${error.message}`);
  }
  refused += error || messages.some(({ type }) => type !== 'info') ? 1 : 0;
}
console.log(`Tint refuses ${refused} of ${names.length} texts`);
process.exit(refused === 0 && names.length > 0 ? 0 : 1);
