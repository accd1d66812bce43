// Runs the page's scripts in Node on Dawn, from the npm package of `kernels/tint`. Prints JSON.
//
//     node node.mjs replay MANIFEST.json                               outcome and pairs of each plan of a list
//     node node.mjs check PAGE.html EVERY                              the object of #check&every=EVERY
//     node node.mjs check-altered PAGE.html                            the same with one pair too many expected in a scene
//     node node.mjs measure PAGE.html SIZE…                            the object of #measure, for these sizes
//
// VK_DRIVER_FILES chooses the Vulkan driver, as for every Vulkan program.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const { create, globals } = createRequire(join(here, "../../../kernels/tint/package.json"))("webgpu");
Object.assign(globalThis, globals);
// Held to the end: adapters and devices of an instance that was collected crash.
const gpu = create(["backend=vulkan"]);

// Scripts share a scope, as in the page.
const load = (text, names) => new Function(`${text}\nreturn { ${names} };`)();

async function replay(manifest) {
  const script = readFileSync(join(here, "../../src/commands/page/player.js"), "utf8");
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

// The scripts and the data of a page, without what needs a document.
async function open(path) {
  const page = readFileSync(path, "utf8");
  const part = (begin) => page.split(begin)[1].split("</script>")[0];
  const script = part("<script>").split("// The page: controls")[0];
  const names = "Player, Bundle, Checker, checkReport, Measurer";
  const scripts = load(script, names);
  const bundle = await scripts.Bundle.open(part('id="data">'));
  return { ...scripts, bundle, player: await scripts.Player.open(gpu) };
}

async function check(path, every, alter = () => {}) {
  const { Checker, checkReport, player, bundle } = await open(path);
  alter(bundle);
  const checker = new Checker(player, bundle);
  checker.take(every);
  return checkReport(player, bundle, await checker.run(() => {}));
}

const commands = {
  replay,
  check: (path, every) => check(path, Number(every)),
  "check-altered": (path) => check(path, 1, (bundle) => {
    bundle.checks = bundle.checks.filter(({ expected }) => expected.pairs > 0).slice(0, 1);
    bundle.checks[0].expected.pairs++;
  }),
  measure: async (path, ...sizes) => {
    const { Measurer, player, bundle } = await open(path);
    return new Measurer(player, bundle).run(() => {}, () => false, sizes.map(Number));
  },
};

const [command, ...args] = process.argv.slice(2);
const report = JSON.stringify(await commands[command](...args));
process.stdout.write(`${report}\n`, () => process.exit(0));
