// Runs the page's scripts in Node on Dawn, from the npm package of `kernels/tint`. Prints JSON.
//
//     node node.mjs replay MANIFEST.json                               outcome and pairs of each plan of a list
//     node node.mjs check PAGE.html [full]                             the object of #check for every sixth scene, or of #check&full
//     node node.mjs check-altered PAGE.html                            the same with one pair too many expected in a scene
//     node node.mjs check-lost PAGE.html                               the errors of two checks whose devices are lost meanwhile
//     node node.mjs check-small PAGE.html                              the object of a check with WebGPU's least limits, and errors
//     node node.mjs probe PAGE.html [altered]                          the result of the probe of subgroups, or of one that fails
//     node node.mjs measure PAGE.html SIZE…                            the object of #measure, for two scenes and these sizes,
//                                                                      with one tile of a crowd per submission
//
// VK_DRIVER_FILES chooses the Vulkan driver, as for every Vulkan program.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const { create, globals } = createRequire(join(here, "../../../../kernels/tint/package.json"))("webgpu");
Object.assign(globalThis, globals);
// Dawn asks for work at every turn of the event loop, which keeps a processor busy.
globalThis.setImmediate = (work, ...args) => setTimeout(work, 1, ...args);
// Held to the end: adapters and devices of an instance that was collected crash.
const gpu = create(["backend=vulkan"]);

// Scripts share a scope, as in the page.
const load = (text, names) => new Function(`${text}\nreturn { ${names} };`)();

async function replay(manifest) {
  const script = readFileSync(join(here, "../../../src/commands/page/player.js"), "utf8");
  const { Player, PlannedCall } = load(script, "Player, PlannedCall");
  const player = await Player.open(gpu), results = [];
  for (const { plan: path, spheres, count } of JSON.parse(readFileSync(manifest, "utf8"))) {
    const plan = JSON.parse(readFileSync(path, "utf8"));
    const rows = new Uint8Array(plan.spheres * 16);
    rows.set(readFileSync(spheres));
    const inputs = {
      spheres: player.buffer("spheres", GPUBufferUsage.STORAGE, rows),
      count: player.buffer("count", GPUBufferUsage.STORAGE, new Uint32Array([count])),
    };
    const call = await PlannedCall.create(player, plan, inputs);
    const outcome = await call.run();
    results.push({ outcome, pairs: Array.from(await call.readPairs(outcome)) });
    [call, inputs.spheres, inputs.count].forEach((resource) => resource.destroy());
  }
  return results;
}

// The scripts and the data of a page, without what needs a document. `alter` may change the data.
async function open(path, { alter = () => {}, limits, from = gpu } = {}) {
  const page = readFileSync(path, "utf8");
  const part = (begin) => page.split(begin)[1].split("</script>")[0];
  const script = part("<script>").split("// The page: controls")[0];
  const names = "Player, PlannedCall, Bundle, Checker, checkReport, Measurer, machine";
  const scripts = load(script, names);
  const bundle = await scripts.Bundle.open(part('id="data">')), player = await scripts.Player.open(from, limits);
  alter(bundle);
  await player.probe(bundle);
  return { ...scripts, bundle, player };
}

async function check({ Checker, checkReport, player, bundle }, isFull, told = () => {}) {
  const checker = new Checker(player, bundle);
  return checkReport(player, bundle, await checker.run(checker.searches(isFull), told));
}

const message = (work) => work.then(() => null, (error) => error.message);
// The least limits of WebGPU.
const LEAST = {
  maxBufferSize: 256 << 20, maxStorageBufferBindingSize: 128 << 20, maxStorageBuffersPerShaderStage: 8,
  maxComputeWorkgroupStorageSize: 16 << 10, maxComputeWorkgroupsPerDimension: 65535,
};

// WebGPU whose devices say half a second late that they are lost, as on a busy machine.
const late = { requestAdapter: async (options) => {
  const adapter = await gpu.requestAdapter(options), request = adapter.requestDevice.bind(adapter);
  adapter.requestDevice = async (descriptor) => {
    const device = await request(descriptor);
    const lost = device.lost.then((info) => new Promise((done) => setTimeout(done, 500, info)));
    return Object.defineProperty(device, "lost", { value: lost });
  };
  return adapter;
} };

// A check of a few scenes within the least limits, and the errors of plans that need more than there is.
async function checkSmall(path) {
  const opened = await open(path, { limits: LEAST, alter: (bundle) => { bundle.checks = bundle.checks.slice(0, 5); } });
  const { player, bundle, PlannedCall } = opened, report = await check(opened, true);
  const largest = bundle.sizes.length - 1, plan = bundle.planFor(player, 0, "cell-list");
  const buffer = (size) => player.buffer("input", GPUBufferUsage.STORAGE, new Uint8Array(size));
  const inputs = { spheres: buffer(16 * plan.spheres), count: buffer(4) };
  // The device answers as one whose memory is exhausted: the scope for memory is the last that ends.
  const { device } = player, pop = device.popErrorScope.bind(device);
  let scopes = 0;
  device.popErrorScope = async () => (await pop()) ?? (++scopes % 2 === 0 ? new GPUOutOfMemoryError("") : null);
  const exhausted = await message(PlannedCall.create(player, plan, inputs));
  return { report, largest: bundle.obstacle(player, largest, "lazy-grid") ?? null, exhausted };
}

// The place of the word in `SearchParams` of lazygrid-kernels.
const TILES_PER_SUBMISSION = 13;

async function measure(path, ...sizes) {
  const alter = (bundle) => {
    bundle.scenes = [bundle.scenes[1], bundle.scenes.at(-1)];
    const planFor = bundle.planFor.bind(bundle);
    bundle.planFor = (...of) => {
      const plan = planFor(...of);
      for (const { name, words } of plan.buffers) if (name === "params" && words) words[TILES_PER_SUBMISSION] = 1;
      return plan;
    };
  };
  const { Measurer, player, bundle } = await open(path, { alter });
  return new Measurer(player, bundle).run(() => {}, () => false, sizes.map(Number));
}

const commands = {
  replay,
  check: async (path, full) => {
    const isFull = full === "full", every = isFull ? 1 : 6;
    const alter = (bundle) => { bundle.checks = bundle.checks.filter((_, at) => at % every === 0); };
    return check(await open(path, { alter }), isFull);
  },
  "check-altered": async (path) => check(await open(path, { alter: (bundle) => {
    bundle.checks = bundle.checks.filter(({ expected }) => expected.pairs > 0).slice(0, 1);
    bundle.checks[0].expected.pairs++;
  } }), false),
  "check-lost": async (path) => {
    const ended = [], alter = (bundle) => {
      bundle.checks = bundle.checks.slice(0, 4).map((scene) => ({ ...scene, calls: scene.calls.filter(({ algorithm }) => algorithm === "naive") }));
    };
    // A scene has two searches: the device is lost within a scene, then between two.
    for (const last of [3, 4]) {
      const opened = await open(path, { alter, from: late });
      let rows = 0;
      const error = await message(check(opened, true, () => { if (++rows === last) opened.player.device.destroy(); }));
      ended.push({ rows, error });
    }
    return ended;
  },
  "check-small": checkSmall,
  probe: async (path, altered) => {
    const alter = (bundle) => {
      const text = bundle.text.bind(bundle);
      bundle.text = (number) => text(number).replace("select(1u, 0u, is_full)", "1u");
    };
    const { player, bundle, machine } = await open(path, altered ? { alter } : {});
    return { texts: player.subgroupTexts(bundle.subgroups), subgroups: machine(player, bundle).gpu.subgroups };
  },
  measure,
};

const [command, ...args] = process.argv.slice(2);
const report = JSON.stringify(await commands[command](...args));
process.stdout.write(`${report}\n`, () => process.exit(0));
