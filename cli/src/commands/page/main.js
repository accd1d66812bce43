"use strict";
// The page: controls, figures and tables.

const element = (id) => document.getElementById(id);
const made = (tag, parent, set = {}) => parent.appendChild(Object.assign(document.createElement(tag), set));

// Three digits and a unit of thousands.
function short(number) {
  const units = [[1e9, " G"], [1e6, " M"], [1e3, " k"]], [unit, name] = units.find(([unit]) => number >= unit) ?? [1, ""];
  return `${Number((number / unit).toPrecision(3))}${name}`;
}

const COLORS = { naive: "#adb5bd", "array-grid": "#4dabf7", "eager-grid": "#b197fc", "lazy-grid": "#63e6be", "cell-list": "#ff922b" };
const TITLES = { auto: "Automatic", naive: "Naive (all pairs)", "array-grid": "ArrayGrid", "eager-grid": "EagerGrid", "lazy-grid": "LazyGrid", "cell-list": "Cell list" };

class SceneTab {
  constructor(player, bundle) {
    Object.assign(this, { player, bundle, stage: new Stage(player, bundle, element("stage")), paused: false, seconds: [], frames: [], turn: 0, configured: null });
    bundle.scenes.forEach(({ title }, value) => made("option", element("kind"), { value, textContent: title }));
    ["auto", ...bundle.algorithms].forEach((value) => made("option", element("algorithm"), { value, textContent: TITLES[value] }));
    element("size").max = bundle.sizes.length - 1;
    this.fromHash();
    for (const id of ["kind", "size", "filling", "algorithm"]) element(id).oninput = () => this.configure();
    element("speed").oninput = () => this.texts();
    element("pause").onclick = () => this.pause(!this.paused);
    element("home").onclick = () => { Object.assign(this.stage.camera, new Camera()); };
    this.listen();
  }

  // `#scene=burst&spheres=100000&algorithm=lazy-grid&filling=5&speed=1&pause=2`
  fromHash() {
    const asked = new URLSearchParams(location.hash.slice(1)), { bundle } = this;
    const at = (list, name) => Math.max(0, list.findIndex((entry) => entry === name));
    element("kind").value = at(bundle.scenes.map(({ name }) => name), asked.get("scene") ?? "five-sizes");
    const usual = this.stage.copies ? 3000 : 100000;
    element("size").value = at(bundle.sizes.map(({ spheres }) => spheres), Number(asked.get("spheres") ?? usual));
    element("algorithm").value = asked.get("algorithm") ?? "auto";
    for (const name of ["filling", "speed"]) if (asked.has(name)) element(name).value = asked.get(name);
    this.pauseAfter = asked.has("pause") ? Number(asked.get("pause")) : Infinity;
  }

  listen() {
    const { camera, canvas } = this.stage, pointers = new Map();
    canvas.onpointerdown = (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, event);
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => pointers.delete(event.pointerId);
    canvas.onpointermove = (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const apart = () => {
        const [a, b] = [...pointers.values()];
        return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
      };
      const old = pointers.size === 2 ? apart() : 0;
      pointers.set(event.pointerId, event);
      if (pointers.size === 1) camera.orbit(event.clientX - before.clientX, event.clientY - before.clientY);
      if (pointers.size === 2) camera.zoom(old / Math.max(1, apart()));
    };
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      camera.zoom(Math.exp(Math.sign(event.deltaY) * 0.1));
    }, { passive: false });
    document.onkeydown = ({ key, target }) => {
      if (key === " " && target.tagName !== "BUTTON") this.pause(!this.paused);
    };
  }

  pause(on) {
    this.paused = on;
    element("pause").textContent = on ? "Continue" : "Pause";
  }

  asked() {
    const number = (id) => Number(element(id).value);
    return { kind: this.bundle.scenes[number("kind")], size: number("size"), filling: number("filling") / 100, algorithm: element("algorithm").value };
  }

  texts() {
    element("size-text").textContent = short(this.bundle.sizes[this.asked().size].spheres);
    element("filling-text").textContent = `${element("filling").value} %`;
    element("speed-text").textContent = `${element("speed").value} ×`;
  }

  // Prepares the controls' scene once earlier calls have ended, unless a later one has replaced this one. A plan whose
  // capacity was exceeded gives way to one for more spheres.
  configure(room = 0) {
    this.texts();
    const turn = ++this.turn, before = this.configured;
    this.busy = true;
    this.configured = (async () => {
      await before?.catch(() => {});
      if (turn === this.turn) await this.prepare(room);
    })();
    return this.configured;
  }

  // Ends the configuration and frees the scene's memory.
  async leave() {
    this.turn++;
    await this.configured?.catch(() => {});
    this.stage.release();
  }

  async prepare(room) {
    const asked = this.asked(), { turn } = this;
    Object.assign(this, { seconds: [], frames: [], busy: true });
    try {
      const why = this.bundle.obstacle(this.player, asked.size, asked.algorithm);
      if (why) throw new PlayerError(`${why}; choose fewer spheres or another algorithm`);
      element("note").textContent = room ? "" : "preparing …";
      await this.stage.configure(asked, room);
      element("note").textContent = "";
      this.planTable();
    } catch (error) {
      this.stage.release();
      element("note").textContent = error.message;
      if (!(error instanceof PlayerError)) throw error;
    } finally {
      this.busy = turn !== this.turn;
    }
  }

  planTable() {
    const { plan } = this.stage.set, { cost } = plan;
    const bytes = (number) => short(number).replace(/( [kMG])?$/, (unit) => `${unit || " "}B`);
    const rows = [
      ["algorithm", TITLES[plan.algorithm]], ["dispatches", cost.dispatches],
      ["memory to work in", bytes(cost.working_bytes)], ["memory for pairs", bytes(cost.pair_bytes)],
      ["traffic per sphere", cost.traffic_bytes === null ? "varies" : bytes(Math.round(cost.traffic_bytes / plan.spheres))],
    ];
    element("plan").replaceChildren();
    for (const [name, value] of rows) {
      const row = made("tr", element("plan"));
      made("td", row, { textContent: name, className: "dim" });
      made("td", row, { textContent: value });
    }
  }

  frame(now) {
    const { stage } = this, moved = this.last === undefined || this.paused ? 0 : Math.min(0.1, (now - this.last) / 1000);
    if (stage.set && !this.busy) {
      const drawn = stage.draw(moved * Number(element("speed").value), (told) => this.told(told));
      if (!drawn) return;
      this.frames.push(now);
      this.last = now;
      if (stage.frame >= this.pauseAfter && !this.paused) this.pause(true);
    }
  }

  told({ outcome, seconds, phases }) {
    const { stage } = this, { count, asked, plan } = stage.set;
    element("pairs").textContent = outcome.found.toLocaleString("en-US");
    element("per-sphere").textContent = `${(outcome.found / count).toPrecision(3)} per sphere, ${short(count)} spheres`;
    const scarce = outcome.exceeded.filter((name) => name !== "pairs" && name !== "work");
    if (scarce.length > 0 && !this.busy) {
      if (asked.size + asked.room + 1 < this.bundle.sizes.length) this.configure(asked.room + 1);
      else element("note").textContent = `the ${scarce.join(" and the ")} exceed what this page has plans for: some pairs are missing; choose fewer spheres`;
      return;
    }
    element("note").textContent = outcome.partial ? "the cells are too crowded for one frame: some pairs are missing; choose fewer spheres"
      : outcome.exceeded.includes("pairs") ? `all pairs are counted, and the first ${short(plan.pairs)} of them colored` : "";
    if (seconds) this.seconds.push(seconds);
    if (this.seconds.length > 60) this.seconds.shift();
    this.stageTable(phases);
  }

  stageTable(phases) {
    const recent = this.frames.slice(-60), rate = (1000 * (recent.length - 1)) / (recent.at(-1) - recent[0]);
    const means = phases.map((_, k) => this.seconds.reduce((sum, seconds) => sum + seconds[k], 0) / Math.max(1, this.seconds.length));
    const all = means.reduce((a, b) => a + b, 0), table = element("stages");
    const rows = this.player.timed
      ? [...phases.map((phase, k) => [phase, means[k] / (all || 1), `${(means[k] * 1e3).toFixed(2)} ms`]), ["all pairs", null, `${(all * 1e3).toFixed(2)} ms`]]
      : [["no timestamps", null, ""]];
    if (Number.isFinite(rate)) rows.push(["picture", null, `${rate.toFixed(rate < 10 ? 1 : 0)} frames/s`]);
    table.replaceChildren();
    for (const [name, part, text] of rows) {
      const row = made("tr", table);
      made("td", row, { textContent: name, className: "dim" });
      const bar = made("td", row);
      if (part !== null) made("i", bar).style.width = `${part * 100}%`;
      made("td", row, { textContent: text });
    }
  }
}

class ReportTab {
  constructor(page, { title, text, columns, run }) {
    Object.assign(this, { page, title, text, columns, work: run });
  }

  show() {
    document.querySelector("#report h2").textContent = this.title;
    document.querySelector("#report p").textContent = this.text;
    for (const id of ["plots", "rows", "status", "result"]) element(id).replaceChildren();
    element("run").onclick = () => this.run();
    element("copy").hidden = true;
  }

  row(cells) {
    if (!element("rows").firstChild) {
      const head = made("tr", made("thead", element("rows")));
      this.columns.forEach((textContent) => made("th", head, { textContent }));
      this.body = made("tbody", element("rows"));
    }
    const row = made("tr", this.body);
    for (const cell of cells) {
      const made_cell = made("td", row, { className: typeof cell === "number" ? "number" : "" });
      if (cell instanceof Node) made_cell.append(cell);
      else made_cell.textContent = typeof cell === "number" ? cell.toLocaleString("en-US", { maximumSignificantDigits: 4 }) : cell;
    }
  }

  async run() {
    this.show();
    // Error scopes and timings are those of the device, so that nothing else may run.
    const locked = [element("run"), ...document.querySelectorAll("nav button")];
    locked.forEach((button) => { button.disabled = true; });
    element("progress").hidden = false;
    await this.page.left;
    element("progress").removeAttribute("value");
    let report;
    try {
      report = await this.work(this);
    } catch (error) {
      report = failed((await this.page.player.isLost()) ? this.page.player.lost : error.message);
    }
    locked.forEach((button) => { button.disabled = false; });
    element("progress").hidden = true;
    element("status").textContent = report.ok ? `all right, ${report.seconds.toFixed(0)} s` : `${report.wrong} wrong`;
    element("status").className = report.ok ? "pass" : "fail";
    element("result").textContent = JSON.stringify(report, null, 1);
    element("copy").hidden = false;
    element("copy").onclick = () => navigator.clipboard.writeText(element("result").textContent);
  }
}

function download(name, text) {
  const link = document.createElement("a");
  return Object.assign(link, { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name, textContent: name });
}

class Page {
  static async open() {
    const player = await Player.open(navigator.gpu);
    const page = new Page();
    Object.assign(page, { player, bundle: await Bundle.open(element("data").textContent) });
    await player.probe(page.bundle);
    const about = machine(player, page.bundle);
    element("machine").textContent = `${about.gpu.name}, ${about.gpu.subgroups}, lazygrid ${about.version} (${about.commit})`;
    player.device.lost.then(() => fail(player.lost));
    page.tabs = { check: page.checkTab(), measure: page.measureTab() };
    page.scene = new SceneTab(player, page.bundle);
    document.querySelectorAll("nav button").forEach((button) => { button.onclick = () => page.turn(button.dataset.tab); });
    const [asked] = location.hash.slice(1).split("&");
    await page.turn(page.tabs[asked] ? asked : "scene");
    page.tabs[asked]?.run();
    const tick = (now) => {
      if (player.lost) return;
      if (page.tab === "scene") page.scene.frame(now);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
    return page;
  }

  async turn(tab) {
    this.tab = tab;
    document.querySelectorAll("nav button").forEach((button) => button.setAttribute("aria-selected", button.dataset.tab === tab));
    for (const id of ["view", "side"]) element(id).hidden = tab !== "scene";
    element("report").hidden = tab === "scene";
    // The other tabs need the scene's memory.
    if (tab === "scene") return this.scene.configure();
    this.tabs[tab].show();
    return this.left = this.scene.leave();
  }

  checkTab() {
    return new ReportTab(this, {
      title: "Check", columns: ["scene", "algorithm", "variant", "result", ""],
      text: "Every algorithm searches scenes that are hard on grids, in every variant of the kernels that this GPU can run " +
        "(without hardware, in one variant for each kind of scene). " +
        "The pairs are compared with those that the CPU found when this page was written.",
      run: async (tab) => {
        const asked = new URLSearchParams(location.hash.slice(1)), checker = new Checker(this.player, this.bundle);
        const scenes = checker.searches(asked.has("full") || !this.player.isSoftware);
        const all = scenes.reduce((sum, { searches }) => sum + searches.length, 0);
        let done = 0;
        const result = await checker.run(scenes, ({ scene, algorithm, variant }, what) => {
          Object.assign(element("progress"), { max: all, value: ++done });
          element("status").textContent = `${done} of ${all}`;
          if (what === null) return;
          const mark = Object.assign(document.createElement("span"), { className: what ? "fail" : "pass", textContent: what ? `WRONG: ${what}` : "pass" });
          tab.row([scene, algorithm, variant, mark, ""]);
        });
        for (const [k, failure] of result.failures.entries()) {
          const name = `lazygrid-check-${k + 1}.csv`;
          tab.row([failure.scene.name, failure.name, "", download(name, await checker.csv(failure)), ""]);
        }
        return checkReport(this.player, this.bundle, result);
      },
    });
  }

  measureTab() {
    const algorithms = this.bundle.algorithms;
    return new ReportTab(this, {
      title: "Measure", columns: ["scene", "spheres", "algorithm", "pairs", "ms on the GPU", "ns per sphere", "ms with readback"],
      text: "Every algorithm searches every scene at 10 k, 100 k, 1 M and 10 M spheres, as far as this GPU can hold them and no call takes " +
        "long. Times are medians. Copy the JSON at the end, and give it to lazygrid-bench.",
      run: async (tab) => {
        const measurer = new Measurer(this.player, this.bundle), speeds = [];
        const asked = new URLSearchParams(location.hash.slice(1)).get("sizes");
        const report = await measurer.run((row) => {
          speeds.push(row);
          element("status").textContent = `${row.algorithm}, ${short(row.spheres)} spheres, ${row.scene}`;
          tab.row([row.scene, short(row.spheres), row.algorithm, row.pairs, row.divided ? "–" : row.busy_seconds * 1e3, (row.busy_seconds / row.spheres) * 1e9, row.seconds * 1e3]);
        }, undefined, asked?.split(",").map(Number));
        for (const { name, title } of this.bundle.scenes) {
          const of = speeds.filter((row) => row.scene === name);
          if (of.length === 0) continue;
          const figure = made("figure", element("plots"));
          made("figcaption", figure, { textContent: `${title}: time per sphere` });
          plotSpeeds(made("canvas", figure), of, COLORS);
        }
        const keys = made("div", element("plots"));
        for (const algorithm of algorithms) {
          const key = made("span", keys, { className: "key" });
          made("i", key).style.background = COLORS[algorithm];
          made("span", key, { textContent: TITLES[algorithm] });
        }
        return report;
      },
    });
  }
}

// The report of a page that cannot work.
const failed = (what) => ({ ok: false, wrong: 1, failures: [{ name: "the page itself", what }] });

// Shows the fault and the remedy, as text and as JSON.
function fail(message) {
  Object.assign(element("failure"), { hidden: false, textContent: message });
  element("result").textContent ||= JSON.stringify(failed(message), null, 1);
}

Page.open().then((page) => { window.page = page; }, (error) => fail(error.message));
