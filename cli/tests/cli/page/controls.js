// Uses each control of the page's scene as a person does, and returns what it changed. Evaluated in the page.
async () => {
  const byId = (id) => document.getElementById(id);
  const until = async (holds) => {
    while (!holds()) await new Promise((done) => setTimeout(done, 20));
  };
  await until(() => window.page);
  const { scene, bundle } = window.page, { stage } = scene, { camera, canvas } = stage;
  const tell = scene.told.bind(scene);
  let last, told = 0;
  scene.told = (frame) => {
    tell(frame);
    last = frame;
    told++;
  };
  // More frames than may be pending.
  const settled = async () => {
    await until(() => !scene.busy);
    const before = told;
    await until(() => (told >= before + 5 && !scene.busy) || byId("note").textContent !== "");
  };
  const state = () => ({
    pairs: last.outcome.found, shown: byId("pairs").textContent, count: stage.set?.count, time: stage.time,
    algorithm: stage.set?.plan.algorithm, note: byId("note").textContent,
  });
  const set = async (id, value) => {
    byId(id).value = value;
    byId(id).dispatchEvent(new Event("input"));
    await settled();
    return { value, text: byId(`${id}-text`)?.textContent, ...state() };
  };
  const sized = (spheres) => bundle.sizes.findIndex((size) => size.spheres === spheres);
  const report = {};

  await until(() => scene.paused);
  report.kinds = [];
  for (const kind of bundle.scenes.keys()) report.kinds.push(await set("kind", kind));
  await set("kind", 0);
  report.algorithms = [];
  for (const { value } of byId("algorithm").options) report.algorithms.push(await set("algorithm", value));
  await set("algorithm", "auto");
  report.fillings = [await set("filling", 1), await set("filling", 30)];
  await set("filling", 5);
  report.sizes = [await set("size", sized(3000)), await set("size", sized(1000))];
  byId("algorithm").value = "naive";
  report.refused = await set("size", bundle.sizes.length - 1);
  byId("algorithm").value = "auto";
  await set("size", sized(1000));

  report.paused = [state(), (await settled(), state())];
  const press = () => document.body.dispatchEvent(new KeyboardEvent("keydown", { key: " ", bubbles: true }));
  byId("speed").value = 0;
  scene.pauseAfter = Infinity;
  byId("pause").click();
  report.label = byId("pause").textContent;
  report.speeds = [state(), await set("speed", 0), await set("speed", 4)];
  press();
  report.stopped = scene.paused;
  press();
  report.continued = !scene.paused;

  const view = () => ({ turn: camera.turn, tilt: camera.tilt, distance: camera.distance });
  // A made event has no pointer to capture.
  canvas.setPointerCapture = () => {};
  const pointer = (type, pointerId, clientX, clientY) =>
    canvas.dispatchEvent(new PointerEvent(type, { pointerId, clientX, clientY }));
  report.views = [view()];
  pointer("pointerdown", 1, 100, 100);
  pointer("pointermove", 1, 180, 140);
  report.views.push(view());
  pointer("pointerdown", 2, 300, 140);
  pointer("pointermove", 2, 420, 140);
  report.views.push(view());
  pointer("pointerup", 1, 0, 0);
  pointer("pointerup", 2, 0, 0);
  pointer("pointermove", 1, 0, 0);
  canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: 1, cancelable: true }));
  report.views.push(view());
  byId("home").click();
  report.views.push(view());

  const tab = (name) => document.querySelector(`[data-tab=${name}]`).click();
  tab("measure");
  report.tabs = [byId("view").hidden, byId("report").hidden, document.querySelector("#report h2").textContent];
  let copied;
  Object.defineProperty(navigator, "clipboard", { value: { writeText: (text) => { copied = text; } } });
  window.page.tabs.measure.work = async () => ({ ok: true, wrong: 0, seconds: 1 });
  byId("run").click();
  await until(() => !byId("copy").hidden);
  byId("copy").click();
  report.copied = JSON.parse(copied);
  tab("scene");
  await settled();
  const failures = [];
  window.addEventListener("unhandledrejection", ({ reason }) => failures.push(String(reason)));
  for (const spheres of [3000, 1000, 10000, 3000]) {
    byId("size").value = sized(spheres);
    byId("size").dispatchEvent(new Event("input"));
  }
  await settled();
  report.hurried = { failures, ...state() };
  await set("size", sized(1000));
  report.tabs.push(byId("view").hidden, byId("report").hidden);
  report.back = state();
  return report;
}
