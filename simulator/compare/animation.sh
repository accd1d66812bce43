#!/usr/bin/env bash
# Times the frames of an animation of the burst scenario, one per step, in a headless Chromium with SwiftShader. Prints
# medians in milliseconds: the page's script when it shows a frame first and again, its drawing calls, and the wait for them.
# Usage: simulator/compare/animation.sh [PARTICLES [FRAMES]]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

particles=${1:-100000} frames=${2:-60}
lazygrid=${CARGO_TARGET_DIR:-target}/release/lazygrid
[ -n "${SKIP_BUILD:-}" ] || cargo build --quiet --release -p lazygrid-cli

scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT
sed "s/count = 50000/count = $((particles / 10))/" simulator/scenarios/burst.toml >"$scratch/burst.toml"
"$lazygrid" simulate "$scratch/burst.toml" --steps "$frames" --backend cpu --output "$scratch/run" --animate --animate-every 1 \
    --animate-particles "$particles" >/dev/null 2>&1
cat "$scratch/run/animation.html" - >"$scratch/probe.html" <<'HTML'
<script>
window.addEventListener("load", () => {
  const { player } = window, { scene, stage } = player, times = { first: [], again: [], draws: [], drawn: [] };
  const gl = stage.canvas.getContext("webgl2"), pixel = new Uint8Array(4);
  player.play(false);
  for (const shown of [times.first, times.again])
    for (let k = 1; k < scene.frames.length; k++) {
      const moments = [performance.now()], note = () => moments.push(performance.now());
      player.go(k);
      note();
      stage.draw();
      note();
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      note();
      [shown, times.draws, times.drawn].forEach((of, part) => of.push(moments[part + 1] - moments[part]));
    }
  const median = (values) => values.sort((a, b) => a - b)[values.length >> 1].toFixed(2);
  const count = scene.frames.at(-1).counts.reduce((a, b) => a + b, 0);
  document.body.textContent = `${count} particles, ${scene.frames.length} frames: ` +
    Object.entries(times).map(([name, values]) => `${name} ${median(values)}`).join(", ");
});
</script>
HTML
chromium --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --window-size=1280,800 \
    --timeout=300000 --virtual-time-budget=1000 --dump-dom "file://$scratch/probe.html" 2>/dev/null | grep -o '[0-9]* particles, [^<]*'
