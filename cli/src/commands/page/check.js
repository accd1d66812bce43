"use strict";
// Runs every algorithm on every scene in every variant, and compares the pairs with those of the CPU. On software drivers,
// which compile each kernel for a second, only in one variant, chosen by the kind of scene.

// Describes the difference of a call's pairs from the expected ones, or `null`. Pairs near tangency may be missing,
// as `f32` cannot tell.
function difference(expected, spheres, outcome, pairs) {
  if (outcome.exceeded.length > 0) return `the ${outcome.exceeded.join(" and the ")} exceed their capacity`;
  if (outcome.found * 2 !== pairs.length) return `${outcome.found} pairs counted, ${pairs.length / 2} written`;
  const unsure = new Set(expected.unsure.map(([i, j]) => i * 2 ** 32 + j));
  const checksum = new Checksum();
  let sure = 0;
  for (let k = 0; k < pairs.length; k += 2) {
    const [i, j] = [pairs[k], pairs[k + 1]];
    if (i >= j || j >= spheres) return `(${i}, ${j}) is not a pair of ${spheres} spheres`;
    // A second copy of an unsure pair is an extra pair.
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
    Object.assign(this, { player, bundle, placer: new Placer(player, bundle.wgsl.scene) });
  }

  // The searches of each scene: an algorithm in a variant.
  searches(isFull) {
    const variants = this.variants();
    return this.bundle.checks.map((scene, at) => {
      if (isFull) return { scene, searches: scene.calls.flatMap((call) => variants.map((variant) => ({ ...call, variant }))) };
      // Every kernel compiles for two or three kinds of scenes instead of eight.
      const { periodic, species } = scene, isPortable = !periodic === !species && (!!periodic || at % 2 === 1);
      const variant = variants.at(isPortable ? -1 : 0);
      return { scene, searches: this.bundle.algorithms.flatMap((algorithm) => {
        const ways = scene.calls.filter((call) => call.algorithm === algorithm).map((call) => ({ ...call, variant }));
        const fitting = ways.filter((search) => !this.obstacle(search));
        return (fitting.length > 0 ? fitting : ways).slice(isPortable ? -1 : 0).slice(0, 1);
      }) };
    });
  }

  // The limit that a search exceeds on this device.
  obstacle({ calls }) {
    return this.player.obstacle(this.bundle.plans[this.bundle.calls[calls[0]].plan]);
  }

  // The plans of a search, in order of their capacity for entries.
  plans({ calls, variant }) {
    return calls.map((call) => this.bundle.plan(call, variant.texts));
  }

  // Compiles all kernels at once, in the order of use, which reports errors again.
  async compile(scenes) {
    const all = scenes.flatMap(({ searches }) => searches).filter((search) => !this.obstacle(search));
    await guarded(this.player.device, "compiling the kernels", () => {
      const plans = all.flatMap((search) => this.plans(search));
      for (const kernel of plans.flatMap(({ kernels }) => kernels)) this.player.pipeline(kernel).catch(() => {});
    }).catch(() => {});
  }

  // The native variants of this device, and the portable ones.
  variants() {
    const native = this.player.subgroupTexts(this.bundle.subgroups);
    const portable = { texts: 0, name: "portable" };
    return native === 0 ? [portable] : [{ texts: native, name: `subgroups of ${this.bundle.subgroups[native].size}` }, portable];
  }

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
    const spheres = player.buffer("spheres", usage, padded(scene.spheres, scene.capacity * 4));
    const species = scene.species && player.buffer("species", usage, padded(scene.species, scene.capacity));
    return { spheres, species, count };
  }

  // Runs searches and passes results to `told(row, result)`.
  async run(scenes, told) {
    const { player } = this, start = performance.now();
    const result = { scenes: scenes.length, checked: 0, failures: [], left_out: [] };
    await this.compile(scenes);
    try {
      for (const { scene, searches } of scenes) {
        const inputs = await guarded(player.device, scene.name, () => this.inputs(scene));
        for (const search of searches) await this.search(search, scene, inputs, result, told);
        Object.values(inputs).forEach((buffer) => buffer?.destroy());
      }
    } catch (error) {
      throw (await player.isLost()) ? new PlayerError(player.lost) : error;
    }
    return { ...result, seconds: (performance.now() - start) / 1000 };
  }

  // Adds one search to `result`.
  async search(search, scene, inputs, result, told) {
    const { algorithm, way, variant } = search, obstacle = this.obstacle(search);
    const row = { scene: scene.name, algorithm, variant: `${variant.name}, ${way}` };
    if (obstacle) {
      if (!result.left_out.some(({ why }) => why === obstacle)) result.left_out.push({ algorithm, variant: row.variant, why: obstacle });
      return told(row, null);
    }
    const what = await this.fault(this.plans(search), scene, inputs);
    result.checked++;
    if (what) result.failures.push({ name: `${scene.name}: ${algorithm}, ${row.variant}`, what, spheres: scene.count, scene });
    told(row, what ?? "");
  }

  // Returns the fault of one call, or `null`. If entries exceed a plan's capacity, the next plan runs, like native retries.
  async fault([plan, ...larger], scene, inputs) {
    let call;
    try {
      call = await PlannedCall.create(this.player, plan, inputs);
      const outcome = await call.run();
      if (outcome.exceeded.includes("entries") && larger.length > 0) return await this.fault(larger, scene, inputs);
      return difference(scene.expected, scene.count, outcome, await call.readPairs(outcome));
    } catch (error) {
      if (await this.player.isLost()) throw error;
      return error.message;
    } finally {
      call?.destroy();
    }
  }

  // The spheres of a failing scene as CSV for `lazygrid detect`.
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

// The machine as in `lazygrid check --json`, as far as a browser tells.
function machine(player, bundle) {
  const { info, device, timed } = player;
  const limits = {};
  for (const name of ["maxBufferSize", "maxStorageBufferBindingSize", "maxStorageBuffersPerShaderStage",
    "maxComputeWorkgroupStorageSize", "maxComputeWorkgroupsPerDimension"]) limits[name] = device.limits[name];
  const named = [info.vendor, info.architecture, info.device, info.description].filter(Boolean).join(" ");
  const subgroups = player.refusal ? `no subgroups (${player.refusal})` : !device.features.has("subgroups") ? "no subgroups"
    : info.subgroupMinSize === info.subgroupMaxSize ? `subgroups of ${info.subgroupMinSize}`
    : `subgroups of ${info.subgroupMinSize} to ${info.subgroupMaxSize}`;
  return {
    version: bundle.version, commit: bundle.commit, cpu: null,
    gpu: {
      name: named || "unnamed GPU", driver: globalThis.navigator?.userAgent ?? "unknown", api: "WebGPU",
      hardware: !player.isSoftware, subgroups, timestamps: timed,
    },
    limits,
  };
}

function checkReport(player, bundle, { scenes, checked, failures, left_out, seconds }) {
  const told = failures.map(({ name, what, spheres }) => ({ name, what, file: null, command: null, spheres }));
  return {
    ...machine(player, bundle),
    scenes: { scenes, searches: checked, seconds },
    left_out, failures: told, seconds, ok: failures.length === 0 && checked > 0, wrong: failures.length,
  };
}
