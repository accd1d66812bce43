"use strict";
// Times algorithms on scenes, by the GPU's clock if it has one.

// Time limit of the rounds of a measurement, and their maximum number.
const CALL_SECONDS = 2.5, ROUNDS = 9;
// Browsers round timestamps to 100 µs: a round repeats short calls for this long.
const ROUND_SECONDS = 0.008, MOST_REPEATS = 200;
const MEASURED_SIZES = [10000, 100000, 1000000, 10000000];

const quantile = (sorted, q) => sorted[Math.min(sorted.length - 1, Math.round(q * (sorted.length - 1)))];
const ascending = (numbers) => [...numbers].sort((a, b) => a - b);

class Measurer {
  constructor(player, bundle) {
    Object.assign(this, { player, bundle, placer: new Placer(player, bundle.wgsl.scene) });
  }

  // Mean seconds of the dispatches of `record`, repeated `repeats` times in one pass.
  async timePass(record, repeats) {
    const { device } = this.player, timer = this.player.timed ? new Timer(this.player, 1) : null;
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginComputePass(timer ? { timestampWrites: timer.writes(0) } : {});
    for (let k = 0; k < repeats; k++) record(pass);
    pass.end();
    timer?.resolve(encoder);
    const start = performance.now();
    device.queue.submit([encoder.finish()]);
    await device.queue.onSubmittedWorkDone();
    const wall = (performance.now() - start) / 1000;
    if (!timer) return wall / repeats;
    const [seconds] = Timer.seconds(await this.player.read(timer.ticks, 16));
    timer.destroy();
    return (seconds || wall) / repeats;
  }

  async rounds(record) {
    const once = await this.timePass(record, 1);
    const repeats = Math.max(1, Math.min(MOST_REPEATS, Math.ceil(ROUND_SECONDS / Math.max(once, 1e-6))));
    const seconds = [];
    for (let spent = 0; seconds.length < ROUNDS && spent < CALL_SECONDS; spent += seconds.at(-1) * repeats) {
      seconds.push(await this.timePass(record, repeats));
    }
    return ascending(seconds);
  }

  // Bandwidth of a copy by a kernel, in bytes read and written per second.
  async copy(values) {
    const { device } = this.player;
    const [from, to] = [0, 1].map(() => device.createBuffer({ size: values * 4, usage: GPUBufferUsage.STORAGE }));
    const module = device.createShaderModule({ label: "copy", code: this.bundle.wgsl.copy });
    const pipeline = device.createComputePipeline({ layout: "auto", compute: { module, entryPoint: "copy" } });
    const entries = [from, to].map((buffer, binding) => ({ binding, resource: { buffer } }));
    const bindings = device.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries });
    const seconds = quantile(await this.rounds((pass) => {
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, bindings);
      pass.dispatchWorkgroups(...workgroupsFor(values / 4));
    }), 0.5);
    [from, to].forEach((buffer) => buffer.destroy());
    return { what: "copy", values, seconds, bytes_per_second: (values * 8) / seconds, of_copy: 1 };
  }

  // Runs a call in one submission.
  async once(call, timer) {
    const { device } = this.player, last = call.encode(device.createCommandEncoder(), timer, (full) => this.player.next(full));
    device.queue.submit([last.finish()]);
    return outcomeOf(call.plan, await this.player.read(call.outcome, call.plan.outcome.bytes));
  }

  // One algorithm on a scene: a row of `speeds`. Wall time alone measures calls of several submissions, since one
  // submission of all their dispatches may take longer than drivers allow.
  async speed(plan, count, inputs) {
    const call = await PlannedCall.create(this.player, plan, inputs);
    try {
      const began = performance.now(), first = await call.run();
      const warm = (performance.now() - began) / 1000;
      if (first.exceeded.some((name) => name !== "pairs" && name !== "work")) throw new PlayerError(`the ${first.exceeded.join(" and the ")} exceed their capacity`);
      const walls = [], stages = new Map(call.phases.map((phase) => [phase, 0])), isDivided = first.submissions > 1;
      const timer = this.player.timed && !isDivided ? new Timer(this.player, call.phases.length) : null;
      for (let spent = 0; walls.length < ROUNDS && spent < 0.5 && (walls.length === 0 || warm < CALL_SECONDS); spent += walls.at(-1)) {
        const start = performance.now(), outcome = isDivided ? await call.run() : await this.once(call, timer);
        walls.push((performance.now() - start) / 1000);
        if (outcome.found !== first.found) throw new PlayerError(`${first.found} pairs counted, then ${outcome.found} for the same spheres`);
        if (timer) {
          Timer.seconds(await this.player.read(timer.ticks, timer.ticks.size)).forEach((seconds, k) =>
            stages.set(call.phases[k], stages.get(call.phases[k]) + seconds));
        }
      }
      timer?.destroy();
      const wall = ascending(walls), busy = isDivided ? wall : await this.rounds((pass) => call.dispatch(pass, call.steps));
      return {
        pairs: first.found, seconds: quantile(wall, 0.5), busy_seconds: quantile(busy, 0.5),
        quartiles: { seconds: [0.25, 0.75].map((q) => quantile(wall, q)), busy_seconds: [0.25, 0.75].map((q) => quantile(busy, q)) },
        stages: timer ? Object.fromEntries([...stages].map(([name, seconds]) => [name, seconds / walls.length])) : {},
        rounds: walls.length, gpu: plan.cost, divided: isDivided,
      };
    } finally {
      call.destroy();
    }
  }

  // Runs everything; passes each row to `told`.
  async run(told, stopped = () => false, sizes = MEASURED_SIZES) {
    const { bundle, player } = this, start = performance.now();
    const speeds = [], left_out = [], failures = [], primitives = [];
    for (const values of [1 << 20, 1 << 24]) {
      if (values * 4 <= player.device.limits.maxStorageBufferBindingSize && !stopped()) primitives.push(await this.copy(values));
    }
    for (const [at, kind] of bundle.scenes.entries()) {
      const before = new Map();
      for (const [size, { spheres: count }] of bundle.sizes.entries()) {
        if (!sizes.includes(count)) continue;
        let inputs = null;
        for (const algorithm of bundle.algorithms) {
          if (stopped()) break;
          const row = { backend: "gpu", algorithm, scene: kind.name, spheres: count };
          const [last, seconds] = before.get(algorithm) ?? [count, 0];
          const forecast = seconds * (count / last) ** (algorithm === "naive" ? 2 : 1);
          const why = bundle.obstacle(player, size, algorithm)
            ?? (forecast > CALL_SECONDS ? `about ${forecast.toFixed(0)} s a call` : null);
          if (why) {
            left_out.push({ ...row, why });
            continue;
          }
          try {
            inputs ??= await guarded(player.device, `${count} spheres`, () => this.place(kind, size, count));
            const speed = { ...row, ...(await this.speed(bundle.planFor(player, size, algorithm), count, inputs)) };
            before.set(algorithm, [count, speed.seconds]);
            speeds.push(speed);
            const fault = this.miscount(at, speed, speeds);
            if (fault) failures.push({ name: `${algorithm}, ${count} spheres, ${kind.name}`, what: fault });
            told(speed);
          } catch (error) {
            if (await player.isLost()) throw error;
            const list = /memory|exceed their capacity/.test(error.message) ? left_out : failures;
            list.push({ ...row, name: `${algorithm}, ${count} spheres, ${kind.name}`, what: error.message, why: error.message });
          }
        }
        Object.values(inputs ?? {}).forEach((buffer) => buffer.destroy());
      }
    }
    const clock = player.timed ? "the GPU's clock" : "wall time";
    const wrong = failures.length;
    return {
      ...machine(player, bundle), primitives: { clock, rows: primitives }, speeds, left_out, failures,
      seconds: (performance.now() - start) / 1000, ok: wrong === 0 && speeds.length > 0, wrong,
    };
  }

  async place(kind, size, count) {
    const { spheres, bindings } = this.placer.allocate(count), encoder = this.player.device.createCommandEncoder();
    this.placer.encode(encoder, bindings, kind, count, kind.scales[size], 0);
    this.player.device.queue.submit([encoder.finish()]);
    return { spheres, count: this.player.buffer("count", GPUBufferUsage.STORAGE, new Uint32Array([count])) };
  }

  // Compares a count with the CPU's or the first algorithm's, up to tangent pairs.
  miscount(kind, { pairs, spheres }, speeds) {
    const known = this.bundle.scenes[kind].pairs[spheres];
    const expected = known ?? speeds.find((row) => row.scene === this.bundle.scenes[kind].name && row.spheres === spheres).pairs;
    return Math.abs(pairs - expected) <= 2 + expected / 1e6 ? null : `${pairs} pairs counted where ${expected} are expected`;
  }
}

// Draws nanoseconds per sphere over spheres, both logarithmic, a line per algorithm.
function plotSpeeds(canvas, speeds, colors) {
  const ratio = globalThis.devicePixelRatio || 1, pen = canvas.getContext("2d");
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  Object.assign(canvas, { width: width * ratio, height: height * ratio });
  pen.scale(ratio, ratio);
  const perSphere = ({ busy_seconds, spheres }) => (busy_seconds / spheres) * 1e9;
  const values = speeds.map(perSphere);
  const [low, high] = [Math.floor(Math.log10(Math.min(...values))), Math.ceil(Math.log10(Math.max(...values)) + 1e-9)];
  const x = (n) => 52 + ((Math.log10(n) - 4) / 3) * (width - 70);
  const y = (value) => height - 26 - ((Math.log10(value) - low) / Math.max(1, high - low)) * (height - 40);
  Object.assign(pen, { font: "11px system-ui,sans-serif", fillStyle: "#9fb0c3", strokeStyle: "#2c3542" });
  const mark = (text, at, from, to, align) => {
    pen.textAlign = align;
    pen.fillText(text, ...at);
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
  };
  const time = (k) => `${10 ** (((k % 3) + 3) % 3)} ${["ps", "ns", "µs", "ms", "s"][Math.floor(k / 3) + 1]}`;
  for (let k = low; k <= high; k++) mark(time(k), [46, y(10 ** k) + 4], [52, y(10 ** k)], [width - 18, y(10 ** k)], "right");
  for (const n of MEASURED_SIZES) mark(short(n), [x(n), height - 8], [x(n), 14], [x(n), height - 26], "center");
  for (const [algorithm, color] of Object.entries(colors)) {
    const line = speeds.filter((row) => row.algorithm === algorithm);
    Object.assign(pen, { strokeStyle: color, fillStyle: color, lineWidth: 2 });
    pen.beginPath();
    line.forEach((row) => pen.lineTo(x(row.spheres), y(perSphere(row))));
    pen.stroke();
    line.forEach((row) => {
      pen.beginPath();
      pen.arc(x(row.spheres), y(perSphere(row)), 3, 0, 7);
      pen.fill();
    });
  }
}
