"use strict";
// The moving scene: places spheres, finds their pairs by a plan, and draws from the same buffers.

const BACKGROUND = { r: 0.071, g: 0.086, b: 0.11, a: 1 };
// Frames with a pending outcome.
const READBACKS = 3;

// Parameters for `scene.wgsl`. `scale` is that of 5 % filling.
function sceneUniform(kind, count, scale, time) {
  const words = new ArrayBuffer(80);
  new Uint32Array(words, 0, 4).set([count, kind.is_burst ? 1 : 0, kind.seed, kind.radii.length]);
  new Float32Array(words, 16, 3).set([scale, time, kind.giant_radius]);
  new Uint32Array(words, 28, 1).set([kind.giants]);
  new Float32Array(words, 32, 12).set(kind.radii);
  return words;
}

// Workgroups of 256 threads, over two dimensions.
function workgroupsFor(count) {
  const groups = Math.max(1, Math.ceil(count / 256)), rows = Math.ceil(groups / 65535);
  return [Math.ceil(groups / rows), rows];
}

class Placer {
  constructor(player, wgsl) {
    const module = player.device.createShaderModule({ label: "scene", code: wgsl });
    this.player = player;
    this.pipeline = player.device.createComputePipeline({ layout: "auto", compute: { module, entryPoint: "place" } });
    this.uniform = player.device.createBuffer({ size: 80, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
  }

  allocate(count) {
    const { device } = this.player;
    const usage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST;
    const spheres = device.createBuffer({ label: "spheres", size: Math.max(16, count * 16), usage });
    const entries = [this.uniform, spheres].map((buffer, binding) => ({ binding, resource: { buffer } }));
    return { spheres, bindings: device.createBindGroup({ layout: this.pipeline.getBindGroupLayout(0), entries }) };
  }

  encode(encoder, bindings, kind, count, scale, time) {
    this.player.device.queue.writeBuffer(this.uniform, 0, sceneUniform(kind, count, scale, time));
    const pass = encoder.beginComputePass();
    pass.setPipeline(this.pipeline);
    pass.setBindGroup(0, bindings);
    pass.dispatchWorkgroups(...workgroupsFor(count));
    pass.end();
  }
}

class Camera {
  constructor() {
    Object.assign(this, { turn: 0.6, tilt: 0.35, distance: 3.6 });
  }

  orbit(x, y) {
    this.turn -= x / 200;
    this.tilt = Math.max(-1.57, Math.min(1.57, this.tilt + y / 200));
  }

  zoom(factor) {
    this.distance = Math.max(0.02, Math.min(20, this.distance * factor));
  }

  // Column-major, from the world to the eye, for a scene of this radius.
  matrix(radius) {
    const [ct, st, cp, sp] = [Math.cos(this.turn), Math.sin(this.turn), Math.cos(this.tilt), Math.sin(this.tilt)];
    return [ct, -sp * st, cp * st, 0, 0, cp, sp, 0, -st, -sp * ct, cp * ct, 0, 0, 0, -this.distance * radius, 1];
  }
}

class Stage {
  constructor(player, bundle, canvas) {
    Object.assign(this, { player, bundle, canvas, camera: new Camera(), frame: 0, time: 0 });
    const { device } = player;
    this.placer = new Placer(player, bundle.wgsl.scene);
    // Software adapters cannot hand textures to a compositor: pictures go through memory.
    this.copies = player.isSoftware;
    this.format = this.copies ? "rgba8unorm" : navigator.gpu.getPreferredCanvasFormat();
    this.context = canvas.getContext(this.copies ? "2d" : "webgpu");
    if (!this.copies) this.context.configure({ device, format: this.format, alphaMode: "opaque" });
    const module = device.createShaderModule({ label: "draw", code: bundle.wgsl.draw });
    this.marking = device.createComputePipeline({ layout: "auto", compute: { module, entryPoint: "mark" } });
    const drawing = (vertex, fragment, topology) => device.createRenderPipeline({
      layout: "auto",
      vertex: { module, entryPoint: vertex },
      fragment: { module, entryPoint: fragment, targets: [{ format: this.format }] },
      primitive: { topology },
      depthStencil: { format: "depth32float", depthWriteEnabled: true, depthCompare: "greater" },
    });
    this.spheresDrawn = drawing("sphere_vertex", "sphere_fragment", "triangle-strip");
    this.boxDrawn = drawing("box_vertex", "box_fragment", "line-list");
    this.view = device.createBuffer({ size: 112, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
  }

  // Prepares a scene with the plan of the size `room` steps larger. Must end before the next call begins, because error
  // scopes belong to the device.
  async configure({ kind, size, algorithm, filling }, room = 0) {
    const plan = this.bundle.planFor(this.player, Math.min(size + room, this.bundle.sizes.length - 1), algorithm);
    this.release();
    const { device } = this.player, count = this.bundle.sizes[size].spheres;
    const made = await guarded(device, `${count} spheres`, () => {
      const { spheres, bindings } = this.placer.allocate(plan.spheres);
      const marks = device.createBuffer({ label: "marks", size: Math.max(16, count * 4), usage: GPUBufferUsage.STORAGE });
      return { spheres, bindings, marks, number: this.player.buffer("count", GPUBufferUsage.STORAGE, new Uint32Array([count])) };
    });
    let call;
    try {
      call = await PlannedCall.create(this.player, plan, { spheres: made.spheres, count: made.number });
    } catch (error) {
      [made.spheres, made.marks, made.number].forEach((buffer) => buffer.destroy());
      throw error;
    }
    const asked = { kind, size, algorithm, filling, room };
    const set = { ...made, call, asked, plan, count, kind, filling };
    this.set = set;
    set.timer = this.player.timed ? new Timer(this.player, call.phases.length) : null;
    set.staging = Array.from({ length: READBACKS }, () => device.createBuffer({
      label: "readback", size: 256, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST,
    }));
    const group = (pipeline, buffers) => device.createBindGroup({
      layout: pipeline.getBindGroupLayout(0),
      entries: buffers.map(([binding, buffer]) => ({ binding, resource: { buffer } })),
    });
    const view = [0, this.view];
    set.markBindings = group(this.marking, [view, [1, call.outcome], [2, call.pairs], [3, made.marks]]);
    set.sphereBindings = group(this.spheresDrawn, [view, [4, made.spheres], [5, made.marks]]);
    set.boxBindings = group(this.boxDrawn, [view]);
  }

  destroy({ spheres, marks, number, call, timer, staging = [] }) {
    [spheres, marks, number, call, timer, ...staging].forEach((resource) => resource?.destroy());
  }

  release() {
    if (this.set) this.destroy(this.set);
    this.set = null;
  }

  scale() {
    const { kind, asked, filling } = this.set;
    const grown = kind.is_burst ? 0.7 + 1.2 * Math.sqrt((this.time * 0.05) % 1) : 1;
    return Math.fround(kind.scales[asked.size] * Math.cbrt(0.05 / filling) * (this.time === 0 ? 1 : grown));
  }

  // The distance from the origin to show.
  extent() {
    return this.set.kind.scales[this.set.asked.size] * Math.cbrt(0.05 / this.set.filling) * 8388608 * (this.set.kind.is_burst ? 0.6 : 1);
  }

  // Advances by `seconds`, finds all pairs, and draws. Calls `told` with the outcome some frames later. Returns
  // `false` if the GPU is too busy.
  draw(seconds, told) {
    const { set, player: { device } } = this;
    // The outcomes of all allowed frames are pending.
    if (!set || set.staging.length === 0) return false;
    this.frame++;
    this.time += seconds;
    let encoder = device.createCommandEncoder();
    const scale = this.scale(), extent = this.extent();
    const path = set.kind.is_burst ? this.time : this.time * extent * 0.1;
    this.placer.encode(encoder, set.bindings, set.kind, set.count, scale, path);
    encoder = set.call.encode(encoder, set.timer, (full) => this.player.next(full));
    const pass = encoder.beginComputePass();
    pass.setPipeline(this.marking);
    pass.setBindGroup(0, set.markBindings);
    pass.dispatchWorkgroupsIndirect(set.call.outcome, set.plan.outcome.fields.dispatch_x);
    pass.end();
    const present = this.render(encoder, extent);
    this.readBack(encoder, told, present);
    return true;
  }

  resize() {
    const ratio = window.devicePixelRatio || 1, { canvas } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((length) => Math.max(1, Math.round(length * ratio)));
    if (this.depth && this.depth.width === width && this.depth.height === height) return;
    Object.assign(canvas, { width, height });
    const texture = (format, usage) => this.player.device.createTexture({ size: [width, height], format, usage });
    [this.depth, this.target, this.picture].forEach((old) => old?.destroy());
    this.depth = texture("depth32float", GPUTextureUsage.RENDER_ATTACHMENT);
    if (!this.copies) return;
    this.target = texture(this.format, GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC);
    this.row = Math.ceil(width / 64) * 256;
    this.picture = this.player.device.createBuffer({
      size: this.row * height, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST,
    });
  }

  // Records the drawing. If the canvas cannot be drawn to, returns a function that copies the picture to it.
  render(encoder, extent) {
    this.resize();
    const { canvas, set } = this, { width, height } = canvas;
    const focal = 1.6, aspect = Math.min(1, width / height);
    const view = new ArrayBuffer(112), floats = new Float32Array(view);
    floats.set(this.camera.matrix(extent));
    floats.set([(focal * aspect * height) / width, focal * aspect, 2 / (height * focal * aspect), extent * 0.002], 16);
    new Uint32Array(view, 80, 2).set([this.frame, set.plan.pairs]);
    floats.set([set.kind.is_burst ? 0 : extent, Math.max(...set.kind.radii, set.kind.giant_radius)], 22);
    this.player.device.queue.writeBuffer(this.view, 0, view);
    const target = this.copies ? this.target : this.context.getCurrentTexture();
    const pass = encoder.beginRenderPass({
      colorAttachments: [{ view: target.createView(), loadOp: "clear", storeOp: "store", clearValue: BACKGROUND }],
      depthStencilAttachment: { view: this.depth.createView(), depthLoadOp: "clear", depthStoreOp: "discard", depthClearValue: 0 },
    });
    if (!set.kind.is_burst) {
      pass.setPipeline(this.boxDrawn);
      pass.setBindGroup(0, set.boxBindings);
      pass.draw(24);
    }
    pass.setPipeline(this.spheresDrawn);
    pass.setBindGroup(0, set.sphereBindings);
    pass.draw(4, set.count);
    pass.end();
    if (!this.copies || this.showing) return null;
    const { picture, row } = this;
    encoder.copyTextureToBuffer({ texture: target }, { buffer: picture, bytesPerRow: row }, [width, height]);
    return async () => {
      await picture.mapAsync(GPUMapMode.READ);
      const bytes = new Uint8ClampedArray(picture.getMappedRange()), image = new ImageData(width, height);
      for (let y = 0; y < height; y++) image.data.set(bytes.subarray(y * row, y * row + 4 * width), y * 4 * width);
      picture.unmap();
      this.context.putImageData(image, 0, 0);
    };
  }

  readBack(encoder, told, present) {
    const { set, player: { device } } = this, staging = set.staging.pop(), { bytes } = set.plan.outcome;
    encoder.copyBufferToBuffer(set.call.outcome, 0, staging, 0, bytes);
    if (set.timer) encoder.copyBufferToBuffer(set.timer.ticks, 0, staging, 128, set.timer.ticks.size);
    device.queue.submit([encoder.finish()]);
    if (present) {
      this.showing = present().catch(() => {}).finally(() => { this.showing = null; });
    }
    staging.mapAsync(GPUMapMode.READ).then(() => {
      const outcome = outcomeOf(set.plan, staging.getMappedRange(0, 128).slice(0, bytes));
      const seconds = set.timer ? Timer.seconds(staging.getMappedRange(128, set.timer.ticks.size).slice(0)) : null;
      staging.unmap();
      set.staging.push(staging);
      if (this.set === set) told({ outcome, seconds, phases: set.call.phases });
    }, () => {});
  }
}
