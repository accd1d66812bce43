"use strict";
// Executes call plans of lazygrid through WebGPU; `docs/page.md` describes the format. Needs no page: `node.mjs` runs
// it in Node.

const PLAN_FORMAT = 1;

// A failure with a remedy.
class PlayerError extends Error {}

// Runs `work` and throws the device's errors, which arrive after the call.
async function guarded(device, what, work) {
  device.pushErrorScope("out-of-memory");
  device.pushErrorScope("validation");
  let result, thrown;
  try {
    result = await work();
  } catch (error) {
    thrown = error;
  }
  const [invalid, exhausted] = await Promise.all([device.popErrorScope(), device.popErrorScope()]);
  if (exhausted) throw new PlayerError(`${what}: the GPU is out of memory; choose fewer spheres`);
  if (invalid) throw new PlayerError(`${what}: ${invalid.message}`);
  if (thrown) throw thrown;
  return result;
}

// The device, and choices that depend on its limits.
class Player {
  constructor(adapter, device) {
    Object.assign(this, { adapter, device, info: adapter.info, pipelines: new Map() });
    this.timed = device.features.has("timestamp-query");
    this.isSoftware = !!this.info.isFallbackAdapter || /swiftshader|llvmpipe|basic render/i.test(`${this.info.vendor} ${this.info.architecture} ${this.info.device} ${this.info.description}`);
    device.lost.then(({ message, reason }) => {
      this.lost = `The GPU was lost (${message || reason}). Reload the page; if it happens again, choose fewer spheres.`;
    });
  }

  // Returns `true` if the device was lost, tested by mapping a buffer: calls fail before the device reports the loss.
  async isLost() {
    const probe = this.device.createBuffer({ label: "probe", size: 4, usage: GPUBufferUsage.MAP_READ });
    const works = await probe.mapAsync(GPUMapMode.READ).then(() => true, () => false);
    probe.destroy();
    if (!works) await Promise.race([this.device.lost, new Promise((done) => setTimeout(done, 10000))]);
    return this.lost !== undefined;
  }

  // Opens the best adapter with the largest limits that plans use, or at most `limits`.
  static async open(gpu, limits = {}) {
    if (!gpu) {
      throw new PlayerError(
        "This browser has no WebGPU. Use a current Chrome, Edge, Safari or Firefox; on Linux, WebGPU may have to be enabled.",
      );
    }
    const adapter = await gpu.requestAdapter({ powerPreference: "high-performance" });
    if (!adapter) {
      throw new PlayerError("WebGPU found no GPU. Update the graphics driver, or enable hardware acceleration in the browser.");
    }
    const requiredFeatures = ["timestamp-query", "subgroups"].filter((name) => adapter.features.has(name));
    const names = [
      "maxBufferSize", "maxStorageBufferBindingSize", "maxStorageBuffersPerShaderStage",
      "maxComputeWorkgroupStorageSize", "maxComputeWorkgroupsPerDimension",
    ];
    const requiredLimits = Object.fromEntries(names.map((name) => [name, Math.min(adapter.limits[name], limits[name] ?? Infinity)]));
    return new Player(adapter, await adapter.requestDevice({ requiredFeatures, requiredLimits }));
  }

  // The limit that a plan exceeds, or `undefined`.
  obstacle({ requires }) {
    const limits = this.device.limits;
    const known = {
      storage_binding: limits.maxStorageBufferBindingSize,
      buffer: limits.maxBufferSize,
      storage_buffers: limits.maxStorageBuffersPerShaderStage,
      workgroup_memory: limits.maxComputeWorkgroupStorageSize,
      workgroups_per_dimension: limits.maxComputeWorkgroupsPerDimension,
    };
    const name = Object.keys(requires).find((name) => requires[name] > known[name]);
    return name && `${name.replaceAll("_", " ")}: ${requires[name]} needed, this GPU offers ${known[name]}`;
  }

  // The index of this device's texts among `subgroups`, the sizes of a bundle; 0 is portable.
  subgroupTexts(subgroups) {
    if (!this.device.features.has("subgroups") || this.refusal) return 0;
    const memory = this.device.limits.maxComputeWorkgroupStorageSize;
    const smallest = this.info.subgroupMinSize;
    return Math.max(0, subgroups.findIndex(({ size, workgroup_memory }) => size === smallest && workgroup_memory <= memory));
  }

  // Tests that subgroups are full and lanes follow local indices, which no API promises. On failure `refusal` is the
  // reason, and kernels run without subgroup operations.
  async probe(bundle) {
    const { probe } = bundle, texts = this.subgroupTexts(bundle.subgroups);
    if (texts === 0) return;
    try {
      const bytes = await guarded(this.device, "the probe of subgroups", async () => {
        const { pipeline, bindGroupLayout } = await this.pipeline({ ...probe.kernel, wgsl: bundle.text(probe.kernel.wgsl[texts]) });
        const result = this.buffer("probe", GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC, new Uint32Array(probe.before));
        const bindings = this.device.createBindGroup({ layout: bindGroupLayout, entries: [{ binding: 0, resource: { buffer: result } }] });
        const encoder = this.device.createCommandEncoder(), pass = encoder.beginComputePass();
        pass.setPipeline(pipeline);
        pass.setBindGroup(0, bindings);
        pass.dispatchWorkgroups(probe.workgroups);
        pass.end();
        this.device.queue.submit([encoder.finish()]);
        return this.read(result, 16);
      });
      const [faults, invocations, smallest] = new Uint32Array(bytes);
      const found = Object.entries(probe.faults).find(([, bit]) => faults & bit);
      if (invocations !== probe.invocations) this.refusal = "the probe of subgroups did not run as dispatched";
      else if (found) this.refusal = found[0];
      else if (faults !== 0 || smallest < this.info.subgroupMinSize) this.refusal = "subgroups are smaller than the adapter reports";
    } catch (error) {
      this.refusal = `the probe of subgroups failed: ${error.message}`;
    }
  }

  // Compiles a kernel once; pipelines compile in parallel.
  pipeline({ entry_point, bindings, wgsl }) {
    const known = this.pipelines.get(wgsl);
    if (known) return known;
    const { device } = this;
    const compiled = (async () => {
      const types = { uniform: "uniform", read: "read-only-storage", read_write: "storage" };
      const entries = bindings.map(({ access }, binding) => ({
        binding,
        visibility: GPUShaderStage.COMPUTE,
        buffer: { type: types[access] },
      }));
      const bindGroupLayout = device.createBindGroupLayout({ label: entry_point, entries });
      const module = device.createShaderModule({ label: entry_point, code: wgsl });
      const layout = device.createPipelineLayout({ bindGroupLayouts: [bindGroupLayout] });
      const pipeline = await device.createComputePipelineAsync({
        label: entry_point,
        layout,
        compute: { module, entryPoint: entry_point },
      });
      return { pipeline, bindGroupLayout };
    })();
    this.pipelines.set(wgsl, compiled);
    return compiled;
  }

  buffer(label, usage, data) {
    const size = Math.max(16, Math.ceil(data.byteLength / 16) * 16);
    const buffer = this.device.createBuffer({ label, size, usage, mappedAtCreation: true });
    const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
    new Uint8Array(buffer.getMappedRange(), 0, bytes.length).set(bytes);
    buffer.unmap();
    return buffer;
  }

  next(encoder) {
    this.device.queue.submit([encoder.finish()]);
    return this.device.createCommandEncoder();
  }

  async read(source, size) {
    const bytes = Math.max(4, Math.ceil(size / 4) * 4);
    const staging = this.device.createBuffer({ label: "staging", size: bytes, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
    const encoder = this.device.createCommandEncoder();
    encoder.copyBufferToBuffer(source, 0, staging, 0, bytes);
    this.device.queue.submit([encoder.finish()]);
    await staging.mapAsync(GPUMapMode.READ);
    const copy = staging.getMappedRange().slice(0, size);
    staging.destroy();
    return copy;
  }
}

// The counters of a call, from the bytes of its outcome buffer.
function outcomeOf({ outcome: { fields, overflow_bits } }, bytes) {
  const words = new Uint32Array(bytes);
  const outcome = Object.fromEntries(Object.entries(fields).map(([name, offset]) => [name, words[offset / 4]]));
  // Up to 2^53, far above any count of a day.
  outcome.found = outcome.found_hi * 2 ** 32 + outcome.found_lo;
  outcome.entries = outcome.entries_hi * 2 ** 32 + outcome.entries_lo;
  outcome.exceeded = Object.keys(overflow_bits).filter((name) => outcome.overflow & overflow_bits[name]);
  outcome.partial = outcome.deferred_end < outcome.deferred_blocks;
  return outcome;
}

class PlannedCall {
  // `inputs` has the caller's buffers by the plan's names.
  static async create(player, plan, inputs) {
    if (plan.format !== PLAN_FORMAT) throw new PlayerError(`the plan has format ${plan.format}, and this player reads ${PLAN_FORMAT}`);
    const obstacle = player.obstacle(plan);
    if (obstacle) throw new PlayerError(`${plan.spheres} spheres by ${plan.algorithm}: ${obstacle}; choose fewer spheres`);
    const call = new PlannedCall();
    Object.assign(call, { player, plan, owned: [] });
    const pipelines = await guarded(player.device, "compiling the kernels", () =>
      Promise.all(plan.kernels.map((kernel) => player.pipeline(kernel))));
    try {
      await guarded(player.device, `the buffers for ${plan.spheres} spheres`, () => call.bind(pipelines, inputs));
    } catch (error) {
      call.destroy();
      throw error;
    }
    return call;
  }

  bind(pipelines, inputs) {
    const { player, plan } = this;
    const device = player.device;
    const usageOf = (names) => names.reduce((usage, name) => usage | GPUBufferUsage[name.toUpperCase()], 0);
    this.buffers = plan.buffers.map(({ name, size, usage, source, words }) => {
      if (source === "input") {
        if (!(inputs[name]?.size >= size)) throw new PlayerError(`the plan needs a buffer "${name}" of ${size} bytes`);
        return inputs[name];
      }
      const made = source === "constant"
        ? player.buffer(name, usageOf(usage), new Uint32Array(words))
        : device.createBuffer({ label: name, size, usage: usageOf(usage) });
      this.owned.push(made);
      return made;
    });
    this.outcome = this.buffers[plan.outcome.buffer];
    this.pairs = this.buffers[plan.outcome.pairs];
    this.steps = plan.dispatches.map(({ kernel, phase, buffers, workgroups, indirect }) => {
      const { pipeline, bindGroupLayout } = pipelines[kernel];
      const entries = buffers.map((at, binding) => ({ binding, resource: { buffer: this.buffers[at] } }));
      const bindings = device.createBindGroup({ layout: bindGroupLayout, entries });
      return { pipeline, bindings, phase, workgroups, indirect };
    });
    this.phases = [...new Set(this.steps.map(({ phase }) => phase))];
    this.passes = this.grouped(({ phase }) => phase);
    this.parts = this.grouped(() => "");
  }

  // Groups consecutive dispatches of one part and one `kind` into passes.
  grouped(kind) {
    const passes = [], starts = new Set(this.plan.part_starts);
    this.steps.forEach((step, at) => {
      const last = passes.at(-1);
      if (!last || starts.has(at) || kind(step) !== last.kind) passes.push({ kind: kind(step), starts: starts.has(at), steps: [] });
      passes.at(-1).steps.push(step);
    });
    for (const [at, pass] of passes.entries()) {
      const same = passes.map(({ kind }, k) => (kind === pass.kind ? k : -1)).filter((k) => k >= 0);
      Object.assign(pass, { begins: same[0] === at, ends: same.at(-1) === at });
    }
    return passes;
  }

  dispatch(pass, steps) {
    for (const { pipeline, bindings, workgroups, indirect } of steps) {
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, bindings);
      if (indirect) pass.dispatchWorkgroupsIndirect(this.buffers[indirect.buffer], indirect.offset);
      else pass.dispatchWorkgroups(...workgroups);
    }
  }

  // Records the call in one pass per part, or per phase with a timer. Further parts, which may take as long as
  // drivers allow a submission, go to the encoders that `next` returns. Returns the last encoder.
  encode(encoder, timer, next) {
    for (const { kind, starts, steps, begins, ends } of timer ? this.passes : this.parts) {
      if (starts) encoder = next(encoder);
      const pass = encoder.beginComputePass(timer ? { timestampWrites: timer.writes(this.phases.indexOf(kind), begins, ends) } : {});
      this.dispatch(pass, steps);
      pass.end();
    }
    timer?.resolve(encoder);
    return encoder;
  }

  // Records the continuation of a partial outcome.
  encodeContinuation(encoder) {
    const pass = encoder.beginComputePass();
    this.dispatch(pass, this.steps.slice(this.plan.continuation));
    pass.end();
  }

  // Runs the call: submits its parts, then a continuation for each partial outcome.
  async run() {
    const { device } = this.player, next = (encoder) => this.player.next(encoder);
    device.queue.submit([this.encode(device.createCommandEncoder(), null, next).finish()]);
    for (let submissions = 1 + this.plan.part_starts.length; ; submissions++) {
      const outcome = outcomeOf(this.plan, await this.player.read(this.outcome, this.plan.outcome.bytes));
      if (!outcome.partial) return { ...outcome, submissions };
      const encoder = device.createCommandEncoder();
      this.encodeContinuation(encoder);
      device.queue.submit([encoder.finish()]);
    }
  }

  async readPairs({ found }) {
    const written = Math.min(found, this.plan.pairs);
    return written === 0 ? new Uint32Array() : new Uint32Array(await this.player.read(this.pairs, written * 8));
  }

  destroy() {
    this.owned.forEach((buffer) => buffer.destroy());
  }
}

// Timestamps at both ends of each phase.
class Timer {
  constructor(player, phases) {
    const { device } = player;
    Object.assign(this, { phases, set: device.createQuerySet({ type: "timestamp", count: 2 * phases }) });
    this.ticks = device.createBuffer({ size: 16 * phases, usage: GPUBufferUsage.QUERY_RESOLVE | GPUBufferUsage.COPY_SRC });
  }

  // Timestamps of a pass that begins or ends a phase.
  writes(phase, begins = true, ends = true) {
    const writes = { querySet: this.set };
    if (begins) writes.beginningOfPassWriteIndex = 2 * phase;
    if (ends) writes.endOfPassWriteIndex = 2 * phase + 1;
    return begins || ends ? writes : undefined;
  }

  resolve(encoder) {
    encoder.resolveQuerySet(this.set, 0, 2 * this.phases, this.ticks, 0);
  }

  // Seconds of each phase.
  static seconds(bytes) {
    const ticks = new BigUint64Array(bytes);
    return Array.from({ length: ticks.length / 2 }, (_, k) => Math.max(0, Number(ticks[2 * k + 1] - ticks[2 * k])) * 1e-9);
  }

  destroy() {
    this.set.destroy();
    this.ticks.destroy();
  }
}

// An order-independent digest of pairs: the sum of SplitMix64's finalizer over (i << 32 | j), as two words. Products
// of 64 bits are made of four of 16 bits, since BigInt takes fifty times as long.
class Checksum {
  constructor() {
    this.low = this.high = 0;
  }

  add(i, j) {
    let [high, low] = [i >>> 0, j >>> 0];
    [high, low] = Checksum.shifted(high, low, 30);
    [high, low] = Checksum.times(high, low, 0xbf58476d, 0x1ce4e5b9);
    [high, low] = Checksum.shifted(high, low, 27);
    [high, low] = Checksum.times(high, low, 0x94d049bb, 0x133111eb);
    [high, low] = Checksum.shifted(high, low, 31);
    const sum = this.low + low;
    this.low = sum >>> 0;
    this.high = (this.high + high + (sum > 0xffffffff ? 1 : 0)) >>> 0;
  }

  static shifted(high, low, by) {
    return [(high ^ (high >>> by)) >>> 0, (low ^ ((low >>> by) | (high << (32 - by)))) >>> 0];
  }

  static times(ah, al, bh, bl) {
    const [a0, a1, b0, b1] = [al & 0xffff, al >>> 16, bl & 0xffff, bl >>> 16];
    const low = a0 * b0;
    const middle = a1 * b0 + (low >>> 16);
    const other = a0 * b1 + (middle & 0xffff);
    const carry = a1 * b1 + Math.floor(middle / 65536) + Math.floor(other / 65536);
    return [(carry + Math.imul(ah, bl) + Math.imul(al, bh)) >>> 0, Math.imul(al, bl) >>> 0];
  }

  text() {
    return [this.high, this.low].map((word) => word.toString(16).padStart(8, "0")).join("");
  }
}
