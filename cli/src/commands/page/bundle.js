"use strict";
// The plans, kernels and scenes of the page, as gzipped JSON in base64.

class Bundle {
  constructor(contents) {
    Object.assign(this, contents);
  }

  static async open(base64) {
    const packed = new Blob([Uint8Array.from(atob(base64.trim()), (letter) => letter.charCodeAt(0))]).stream();
    return new Bundle(await new Response(packed.pipeThrough(new DecompressionStream("gzip"))).json());
  }

  // The plan of a call, with its constants and the texts of its kernels; `subgroups` is that of `Player.subgroupTexts`.
  plan(call, subgroups) {
    const { plan, constants } = this.calls[call], skeleton = this.plans[plan];
    let next = 0;
    return {
      ...skeleton,
      buffers: skeleton.buffers.map((buffer) => (buffer.source === "constant" ? { ...buffer, words: constants[next++] } : buffer)),
      kernels: skeleton.kernels.map((kernel) => ({ ...kernel, wgsl: this.text(kernel.wgsl[subgroups]) })),
    };
  }

  // The text of a kernel, joined from runs of lines that kernels share.
  text(number) {
    return this.texts[number].map(([at, count]) => this.lines.slice(at, at + count).join("\n")).join("\n");
  }

  // The first call that a device can run, else the last.
  fitting(player, calls) {
    return calls.find((call) => !player.obstacle(this.plans[this.calls[call].plan])) ?? calls.at(-1);
  }

  // The algorithm in place of `auto`.
  algorithmOf(size, algorithm) {
    return algorithm === "auto" ? this.sizes[size].auto : algorithm;
  }

  // The plan for a size, or `undefined`.
  planFor(player, size, algorithm, portable = false) {
    const calls = this.sizes[size].calls[this.algorithmOf(size, algorithm)];
    return calls && this.plan(this.fitting(player, calls), portable ? 0 : player.subgroupTexts(this.subgroups));
  }

  // The reason why a size is missing on this device, or `undefined`.
  obstacle(player, size, algorithm) {
    const name = this.algorithmOf(size, algorithm), calls = this.sizes[size].calls[name];
    if (!calls) return `${name} tests all pairs, which takes too long for this many spheres`;
    return player.obstacle(this.plans[this.calls[this.fitting(player, calls)].plan]);
  }
}
