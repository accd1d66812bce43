// Opens a page in headless Chromium on SwiftShader and prints JSON: the text of #result, and what the console said.
//
//     node browser.mjs CHROMIUM PROFILE URL WIDTH HEIGHT UNTIL [SCREENSHOT.png]
//
// UNTIL is an expression of the page that becomes true when it is done. The browser is driven through its debugging pipe,
// as its command line has no way to wait for a GPU.
import { spawn } from "node:child_process";
import { writeFileSync } from "node:fs";

const [chromium, profile, url, width, height, until, screenshot] = process.argv.slice(2);
const TIMEOUT = 600_000;
const browser = spawn(chromium, [
  "--headless=new", "--no-sandbox", "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--disable-background-networking",
  "--hide-scrollbars", "--force-device-scale-factor=1", `--window-size=${width},${height}`, `--user-data-dir=${profile}`,
  "--remote-debugging-pipe", "about:blank",
], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });

const waiting = new Map(), said = [];
let number = 0, buffered = "", session;
const send = (method, params = {}) => new Promise((resolve, reject) => {
  waiting.set(++number, { resolve, reject });
  browser.stdio[3].write(`${JSON.stringify({ id: number, method, params, sessionId: session })}\0`);
});
const events = {
  "Runtime.consoleAPICalled": ({ type, args }) => said.push(`${type}: ${args.map(({ value, description }) => value ?? description).join(" ")}`),
  "Runtime.exceptionThrown": ({ exceptionDetails: { text, exception } }) => said.push(`exception: ${exception?.description ?? text}`),
  "Log.entryAdded": ({ entry: { level, text } }) => said.push(`${level}: ${text}`),
};
browser.stdio[4].on("data", (chunk) => {
  const parts = (buffered + chunk).split("\0");
  buffered = parts.pop();
  for (const part of parts) {
    const { id, result, error, method, params } = JSON.parse(part);
    events[method]?.(params);
    if (error) waiting.get(id).reject(new Error(error.message));
    else waiting.get(id)?.resolve(result);
    waiting.delete(id);
  }
});
const end = (code, text) => {
  browser.kill("SIGKILL");
  (code === 0 ? process.stdout : process.stderr).write(`${text}\n`, () => process.exit(code));
};
const timer = setTimeout(() => end(1, `not done after ${TIMEOUT / 1000} s; the console said: ${said.join("\n")}`), TIMEOUT);
browser.on("exit", () => end(1, "the browser ended"));

try {
  const { targetId } = await send("Target.createTarget", { url: "about:blank" });
  ({ sessionId: session } = await send("Target.attachToTarget", { targetId, flatten: true }));
  for (const domain of ["Page", "Runtime", "Log"]) await send(`${domain}.enable`);
  await send("Emulation.setDeviceMetricsOverride", { width: Number(width), height: Number(height), deviceScaleFactor: 1, mobile: false });
  await send("Page.navigate", { url });
  const value = async (expression) => (await send("Runtime.evaluate", { expression, returnByValue: true })).result.value;
  while (!(await value(until))) await new Promise((resolve) => setTimeout(resolve, 100));
  const result = await value('document.getElementById("result").textContent');
  if (screenshot) writeFileSync(screenshot, Buffer.from((await send("Page.captureScreenshot")).data, "base64"));
  clearTimeout(timer);
  browser.removeAllListeners("exit");
  end(0, JSON.stringify({ result, said }));
} catch (error) {
  end(1, error.stack);
}
