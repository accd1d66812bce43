"use strict";
// Runs every algorithm on every scene in every variant, and compares the pairs with those of the CPU.

// Compares the pairs of a call with the expected ones. Pairs near tangency may be found or missed, as `f32` cannot tell.
// Returns a description of the difference, or `null`.
function difference(expected, spheres, outcome, pairs) {
  if (outcome.exceeded.length > 0) return `the ${outcome.exceeded.join(" and the ")} exceed their capacity`;
  if (outcome.found * 2 !== pairs.length) return `${outcome.found} pairs counted, ${pairs.length / 2} written`;
  const unsure = new Set(expected.unsure.map(([i, j]) => i * 2 ** 32 + j));
  const checksum = new Checksum();
  let sure = 0;
  for (let k = 0; k < pairs.length; k += 2) {
    const [i, j] = [pairs[k], pairs[k + 1]];
    if (i >= j || j >= spheres) return `(${i}, ${j}) is not a pair of ${spheres} spheres`;
    // A second copy of an unsure pair counts as an extra pair.
    if (unsure.size > 0 && unsure.delete(i * 2 ** 32 + j)) continue;
    checksum.add(i, j);
    sure++;
  }
  if (sure !== expected.pairs) return `${sure} pairs found where ${expected.pairs} are expected`;
  if (checksum.text() !== expected.checksum) return `${sure} pairs as expected, but others (checksum ${checksum.text()})`;
  return null;
}

class Checker {
  constructor(player, bundle) {
    Object.assign(this, { player, bundle, scenes: bundle.checks, placer: new Placer(player, bundle.wgsl.scene) });
  }

  // Leaves out all scenes but each `every`-th.
  take(every) {
    this.scenes = this.bundle.checks.filter((_, at) => at % every === every - 1);
  }

  // The variants of the kernels: those that this device gets natively, and the portable ones.
  variants() {
    const native = this.player.subgroupTexts(this.bundle.subgroups);
    const portable = { texts: 0, name: "portable" };
    return native === 0 ? [portable] : [{ texts: native, name: `subgroups of ${this.bundle.subgroups[native].size}` }, portable];
  }

  // The buffers of a scene on the device.
  async inputs(scene) {
    const { player } = this, usage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC;
    const count = player.buffer("count", usage, new Uint32Array([scene.count]));
    if (scene.kind !== undefined) {
      const kind = this.bundle.scenes[scene.kind], { spheres, bindings } = this.placer.allocate(scene.capacity);
      const encoder = player.device.createCommandEncoder();
      this.placer.encode(encoder, bindings, kind, scene.count, scene.scale, 0);
      player.device.queue.submit([encoder.finish()]);
      return { spheres, count };
    }
    const padded = (words, count) => {
      const all = new Uint32Array(count);
      all.set(words);
      return all;
    };
    // Rows are the bits of x, y, z and r.
    const spheres = player.buffer("spheres", usage, padded(scene.spheres, scene.capacity * 4));
    const species = scene.species && player.buffer("species", usage, padded(scene.species, scene.capacity));
    return { spheres, species, count };
  }

  // Runs everything. `told(row, result)` hears each result; `stopped()` ends the run early.
  async run(told, stopped = () => false) {
    const { bundle, player, scenes } = this, start = performance.now();
    const result = { scenes: scenes.length, checked: 0, failures: [], left_out: [] };
    const limits = new Map();
    for (const scene of scenes) {
      const inputs = await guarded(player.device, scene.name, () => this.inputs(scene));
      for (const { algorithm, way, call } of scene.calls) {
        for (const variant of this.variants()) {
          if (stopped()) return result;
          const row = { scene: scene.name, algorithm, variant: `${variant.name}, ${way}` };
          const plan = bundle.plan(call, variant.texts), obstacle = player.obstacle(plan);
          if (obstacle) {
            if (!limits.has(obstacle)) result.left_out.push({ algorithm, variant: row.variant, why: obstacle });
            limits.set(obstacle, true);
            told(row, null);
            continue;
          }
          const what = await this.fault(plan, scene, inputs);
          result.checked++;
          if (what) result.failures.push({ name: `${scene.name}: ${algorithm}, ${row.variant}`, what, spheres: scene.count, scene });
          told(row, what ?? "");
        }
      }
      Object.values(inputs).forEach((buffer) => buffer?.destroy());
    }
    return { ...result, seconds: (performance.now() - start) / 1000 };
  }

  // What is wrong with one call, or `null`.
  async fault(plan, scene, inputs) {
    let call;
    try {
      call = await PlannedCall.create(this.player, plan, inputs);
      const outcome = await call.run();
      return difference(scene.expected, scene.count, outcome, await call.readPairs(outcome));
    } catch (error) {
      return this.player.lost ? `the device was lost: ${this.player.lost}` : error.message;
    } finally {
      call?.destroy();
    }
  }

  // A failing scene as a file for `lazygrid detect`.
  async csv({ scene, name, what }) {
    const inputs = await this.inputs(scene);
    const rows = new Float32Array(await this.player.read(inputs.spheres, scene.count * 16));
    const species = scene.species && new Uint32Array(await this.player.read(inputs.species, scene.count * 4));
    Object.values(inputs).forEach((buffer) => buffer?.destroy());
    const periodic = scene.periodic ? ` --periodic ${scene.periodic.map((length) => length ?? "-").join(",")}` : "";
    const lines = [`# ${name}: ${what}`, `# lazygrid detect FILE${periodic}`, `x,y,z,r${species ? ",species" : ""}`];
    for (let k = 0; k < scene.count; k++) {
      const row = Array.from(rows.subarray(4 * k, 4 * k + 4));
      lines.push([...row, ...(species ? [species[k]] : [])].join(","));
    }
    return `${lines.join("\n")}\n`;
  }
}

// What `lazygrid check --json` says of the machine, as far as a browser tells.
function machine(player, bundle) {
  const { info, device, timed } = player;
  const limits = {};
  for (const name of ["maxBufferSize", "maxStorageBufferBindingSize", "maxStorageBuffersPerShaderStage",
    "maxComputeWorkgroupStorageSize", "maxComputeWorkgroupsPerDimension"]) limits[name] = device.limits[name];
  const named = [info.vendor, info.architecture, info.device, info.description].filter(Boolean).join(" ");
  const subgroups = !device.features.has("subgroups") ? "no subgroups"
    : info.subgroupMinSize === info.subgroupMaxSize ? `subgroups of ${info.subgroupMinSize}`
    : `subgroups of ${info.subgroupMinSize} to ${info.subgroupMaxSize}`;
  return {
    version: bundle.version, commit: bundle.commit, cpu: null,
    gpu: {
      name: named || "unnamed GPU", driver: globalThis.navigator?.userAgent ?? "unknown", api: "WebGPU",
      hardware: !(info.isFallbackAdapter || /swiftshader|llvmpipe/i.test(named)), subgroups, timestamps: timed,
    },
    limits,
  };
}

// The object of a check.
function checkReport(player, bundle, { scenes, checked, failures, left_out, seconds }) {
  const told = failures.map(({ name, what, spheres }) => ({ name, what, file: null, command: null, spheres }));
  return {
    ...machine(player, bundle),
    scenes: { scenes, searches: checked, seconds },
    left_out, failures: told, seconds, ok: failures.length === 0 && checked > 0, wrong: failures.length,
  };
}
