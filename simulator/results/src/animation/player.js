const element = (id) => document.getElementById(id);
const made = (tag, parent, set = {}) => parent.appendChild(Object.assign(document.createElement(tag), set));
const shown = (number) => Number(number.toPrecision(4)).toString();

const decoded = new Map();
function placesOf(at) {
  if (!decoded.has(at)) {
    const text = atob(element(`frame-${at}`).textContent), bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    // Bounds the cache to 300 MB.
    if (decoded.size * bytes.length > 3e8) decoded.clear();
    decoded.set(at, bytes);
  }
  return decoded.get(at);
}

class Chart {
  constructor(parent, { title, lines }, times, seek) {
    Object.assign(this, { lines, times });
    this.last = times[times.length - 1] || 1;
    made("h2", parent, { textContent: title });
    this.canvas = made("canvas", parent, { className: "chart" });
    this.canvas.onclick = (event) => seek(((event.offsetX - Chart.LEFT) / (this.canvas.clientWidth - Chart.LEFT - 4)) * this.last);
    const names = made("div", parent);
    for (const line of lines) {
      line.color = colorOf(line.color);
      const name = made("span", names, { className: "name" });
      made("i", name).style.background = line.color;
      made("span", name, { textContent: line.name });
      name.onclick = () => {
        line.hidden = name.classList.toggle("off");
        this.draw(this.now);
      };
    }
  }
  draw(now) {
    this.now = now;
    const { canvas, times, last } = this, ratio = window.devicePixelRatio || 1, pen = canvas.getContext("2d");
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    pen.scale(ratio, ratio);
    const lines = this.lines.filter((line) => !line.hidden);
    const most = lines.reduce((most, { counts }) => counts.reduce((a, b) => Math.max(a, b), most), 1);
    const x = (time) => Chart.LEFT + (time / last) * (width - Chart.LEFT - 4), y = (count) => height - 18 - (count / most) * (height - 26);
    Object.assign(pen, { font: "11px system-ui,sans-serif", fillStyle: "#9fb0c3", strokeStyle: "#2c3542", textAlign: "right" });
    for (const part of [0, 0.5, 1]) {
      pen.fillText(shown(most * part), Chart.LEFT - 4, y(most * part) + 4);
      pen.strokeRect(Chart.LEFT, y(most * part), width - Chart.LEFT - 4, 0);
    }
    pen.fillText(`${shown(last)} s`, width - 4, height - 4);
    for (const { counts, color } of lines) {
      Object.assign(pen, { strokeStyle: color, lineWidth: 1.5 });
      pen.beginPath();
      counts.forEach((count, k) => pen.lineTo(x(times[k]), y(count)));
      pen.stroke();
    }
    Object.assign(pen, { strokeStyle: "#fff", lineWidth: 1 });
    pen.beginPath();
    pen.moveTo(x(now), 4);
    pen.lineTo(x(now), height - 18);
    pen.stroke();
  }
}
Chart.LEFT = 46;

class Player {
  constructor(scene) {
    Object.assign(this, { scene, at: -1, playing: false, due: 0, stage: new Stage(element("stage"), scene) });
    element("side").querySelector("h1").textContent = scene.title;
    element("note").textContent = scene.note;
    element("slider").max = scene.frames.length - 1;
    this.legend();
    this.labels = scene.transceivers.map(({ name }) => made("div", element("view"), { className: "label", textContent: name }));
    const seek = (time) => this.go(scene.frames.reduce((best, { time: t }, k) =>
      Math.abs(t - time) < Math.abs(scene.frames[best].time - time) ? k : best, 0));
    this.charts = scene.charts.map((chart) => new Chart(element("charts"), chart, scene.times, seek));
    this.listen();
    const asked = new URLSearchParams(location.hash.slice(1));
    for (const name of ["turn", "tilt", "distance"])
      if (asked.has(name)) this.stage.camera[name] = Number(asked.get(name)) * (name === "distance" ? scene.view.radius : 1);
    this.go(Number(asked.get("frame")) || 0);
    this.play(!asked.has("frame"));
    requestAnimationFrame((now) => this.tick(now));
  }
  legend() {
    this.scene.species.forEach(({ name }, k) => {
      const entry = made("span", element("species"), { className: "name" });
      made("i", entry).style.background = colorOf(k);
      made("span", entry, { textContent: name });
      entry.onclick = () => {
        entry.classList.toggle("off") ? this.stage.hidden.add(k) : this.stage.hidden.delete(k);
        this.stale = true;
      };
    });
  }
  listen() {
    const { camera, canvas } = this.stage;
    const turned = (change) => { change(); this.stale = true; };
    canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
    canvas.onpointermove = (event) => {
      if (!event.buttons) return;
      const { movementX: x, movementY: y } = event;
      turned(() => {
        if (event.buttons > 1 || event.shiftKey) return camera.pan(x, y);
        camera.turn -= x / 200;
        camera.tilt = Math.max(-1.57, Math.min(1.57, camera.tilt + y / 200));
      });
    };
    canvas.oncontextmenu = (event) => event.preventDefault();
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      turned(() => { camera.distance *= Math.exp(Math.sign(event.deltaY) * 0.1); });
    }, { passive: false });
    element("play").onclick = () => this.play(!this.playing);
    element("slider").oninput = (event) => this.go(Number(event.target.value));
    window.onresize = () => turned(() => this.charts.forEach((chart) => chart.draw(chart.now)));
    window.onkeydown = ({ key }) => {
      if (key === " ") this.play(!this.playing);
      if (key === "ArrowRight") this.go(this.at + 1);
      if (key === "ArrowLeft") this.go(this.at - 1);
    };
  }
  play(on) {
    this.playing = on;
    element("play").textContent = on ? "\u23f8" : "\u25b6";
  }
  go(at) {
    const { frames } = this.scene;
    at = Math.max(0, Math.min(frames.length - 1, at));
    if (at === this.at) return;
    this.at = at;
    const frame = frames[at], drawn = frame.counts.reduce((a, b) => a + b, 0);
    this.stage.show(frame, placesOf(at));
    element("slider").value = at;
    element("moment").textContent = `${shown(frame.time)} s, step ${frame.step}, ${frame.present} particles` +
      (drawn < frame.present ? ` (${drawn} drawn)` : "");
    this.charts.forEach((chart) => chart.draw(frame.time));
    this.stale = true;
  }
  tick(now) {
    if (this.playing && now >= this.due) {
      this.due = Math.max(this.due + 1000 / Number(element("speed").value), now - 100);
      this.go((this.at + 1) % this.scene.frames.length);
    }
    if (this.stale) {
      this.stale = false;
      this.stage.draw();
      this.labels.forEach((label, k) => {
        const place = this.stage.place(this.stage.centerOf(k));
        label.hidden = !place;
        if (place) [label.style.left, label.style.top] = place.map((p) => `${p}px`);
      });
      document.body.dataset.drawn = Number(document.body.dataset.drawn ?? 0) + 1;
    }
    requestAnimationFrame((then) => this.tick(then));
  }
}

try {
  window.player = new Player(JSON.parse(element("scene").textContent));
} catch (error) {
  element("failure").textContent = `This run cannot be shown: ${error.message}`;
}
