"use strict";
// A small viewer of films: orbit, play, slider, colour per vertex. Plain WebGL2, no library, no request.
(async () => {
  const film = JSON.parse(document.getElementById("film").textContent);
  const canvas = document.getElementById("view"), slider = document.getElementById("slider");
  const label = document.getElementById("label"), play = document.getElementById("play");
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
  if (!gl || typeof DecompressionStream === "undefined") {
    label.textContent = "This browser has no WebGL 2 or no DecompressionStream; frames.usdc holds the film.";
    return;
  }
  const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const unpacked = async (text) => {
    const stream = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  };
  for (const still of film.still) still.bytes = await unpacked(still.data);
  let data = await unpacked(film.data), at = 0;
  const planes = (count, width) => {  // numbers of `width` bytes, lowest bytes first
    const values = width === 4 ? new Uint32Array(count) : new Uint16Array(count);
    for (let b = 0; b < width; b++) for (let i = 0; i < count; i++) values[i] += data[at++] << (8 * b);
    return values;
  };
  const interleaved = (values, columns) => {
    const count = values.length / columns, result = new values.constructor(values.length);
    for (let c = 0; c < columns; c++) for (let i = 0; i < count; i++) result[i * columns + c] = values[c * count + i];
    return result;
  };

  // --- unpack
  for (const piece of film.pieces) {
    for (const shape of piece.topologies) {
      shape.index = interleaved(planes(3 * shape.triangles, 4), 3);
      shape.edge = interleaved(planes(2 * shape.edges, 4), 2);
      const steps = interleaved(planes(3 * shape.vertices, 2), 3);
      shape.surface = Float32Array.from(steps, (s, i) => piece.space[i % 3] + (s / 65535) * piece.space[3]);
      shape.maps = {};
      for (const key of Object.keys(film.maps)) {
        shape.maps[key] = data.slice(at, at + shape.vertices);
        at += shape.vertices;
      }
      shape.normals = normalsOf(shape);
    }
    piece.layouts = [];
    let before = null;
    for (const number of piece.frames) {
      let shape = piece.topologies[0];
      for (const each of piece.topologies) if (each.first <= number) shape = each;
      const steps = planes(2 * shape.vertices, 2), colours = data.slice(at, at + shape.vertices);
      at += shape.vertices;
      if (before && before.shape === shape) {
        for (let i = 0; i < steps.length; i++) steps[i] += before.steps[i];
        for (let i = 0; i < colours.length; i++) colours[i] += before.colours[i];
      }
      before = { shape, steps, colours };
      piece.layouts.push({ number, shape, colours, points: placed(piece, steps) });
    }
  }
  for (const still of film.still) {  // the body, and drafted pieces
    [data, at] = [still.bytes, 0];
    still.index = interleaved(planes(3 * still.triangles, 4), 3);
    const steps = interleaved(planes(3 * still.vertices, 2), 3);
    still.surface = Float32Array.from(steps, (s, i) => still.space[i % 3] + (s / 65535) * still.space[3]);
    still.normals = normalsOf(still);
    still.shades = new Uint8Array(still.vertices);
  }
  function placed(piece, steps) {
    const count = steps.length / 2, points = new Float32Array(3 * count), [x, y, size] = piece.box;
    for (let i = 0; i < count; i++) {
      points[3 * i] = piece.offset[0] + x + (steps[i] / 65535) * size;
      points[3 * i + 1] = piece.offset[1] + y + (steps[count + i] / 65535) * size;
      points[3 * i + 2] = piece.offset[2];
    }
    return points;
  }
  function normalsOf(shape) {
    const n = new Float32Array(shape.surface.length), p = shape.surface, t = shape.index;
    for (let i = 0; i < t.length; i += 3) {
      const [a, b, c] = [3 * t[i], 3 * t[i + 1], 3 * t[i + 2]];
      const u = [0, 1, 2].map((k) => p[b + k] - p[a + k]), v = [0, 1, 2].map((k) => p[c + k] - p[a + k]);
      const w = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (const corner of [a, b, c]) for (let k = 0; k < 3; k++) n[corner + k] += w[k];
    }
    for (let i = 0; i < n.length; i += 3) {
      const length = Math.hypot(n[i], n[i + 1], n[i + 2]) || 1;
      for (let k = 0; k < 3; k++) n[i + k] /= length;
    }
    return n;
  }

  // A surface whose face looks away, as a back does, stands turned around beside its pattern; elsewhere it stays as it is.
  const facing = film.pieces.map((piece) => piece.topologies[0]).reduce((sum, { index, surface: p }) => {
    for (let i = 0; i < index.length; i += 3) {
      const [a, b, c] = [3 * index[i], 3 * index[i + 1], 3 * index[i + 2]];
      const [ux, uy, uz, vx, vy, vz] = [b, c].flatMap((end) => [0, 1, 2].map((k) => p[end + k] - p[a + k]));
      const w = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
      sum.ahead += w[2];
      sum.area += Math.hypot(...w);
    }
    return sum;
  }, { ahead: 0, area: 0 });
  if (facing.ahead < -0.12 * facing.area) {
    const all = film.pieces.map((piece) => piece.topologies[0].surface);
    const twice = [0, 2].map((k) => {  // the two ends of the box, added
      let low = 1e9, high = -1e9;
      for (const p of all) for (let i = k; i < p.length; i += 3) { low = Math.min(low, p[i]); high = Math.max(high, p[i]); }
      return low + high;
    });
    for (const shape of [...film.pieces.flatMap((piece) => piece.topologies), ...film.still]) {
      shape.turned = shape.surface.map((value, i) => (i % 3 === 1 ? value : twice[(i % 3) / 2] - value));
      shape.turnedNormals = shape.normals.map((value, i) => (i % 3 === 1 ? value : -value));
    }
  }

  // --- draw
  const program = gl.createProgram();
  const shader = (kind, text) => {
    const made = gl.createShader(kind);
    gl.shaderSource(made, "#version 300 es\nprecision highp float;\n" + text);
    gl.compileShader(made);
    if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
    gl.attachShader(program, made);
  };
  shader(gl.VERTEX_SHADER, `
    layout(location=0) in vec3 position; layout(location=1) in vec3 normal; layout(location=2) in float share;
    uniform mat4 view; uniform float pull; out vec3 n; out float s;
    void main() { gl_Position = view * vec4(position, 1.0); gl_Position.z -= pull * gl_Position.w; n = normal; s = share; }`);
  shader(gl.FRAGMENT_SHADER, `
    in vec3 n; in float s; uniform sampler2D table; uniform vec4 ink; uniform vec3 eye; uniform float fade; uniform float two; uniform vec4 plain; out vec4 colour;
    void main() {
      if (ink.a > 0.0) { colour = vec4(mix(ink.rgb, vec3(0.6), fade), 1.0); return; }
      vec3 base = texture(table, vec2(s * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb;
      // Shorter is blue, longer is red, no strain is white.
      if (two > 0.0) { float d = 2.0 * s - 1.0; base = d < 0.0 ? mix(vec3(0.97), vec3(0.13, 0.40, 0.67), -d) : mix(vec3(0.97), vec3(0.70, 0.09, 0.17), d); }
      base = mix(base, vec3(0.6), 0.75 * fade);
      if (plain.a > 0.0) base = plain.rgb;
      float lit = dot(normalize(n), normalize(eye + vec3(-0.3, 0.5, 0.2)));
      if (dot(n, eye) < 0.0) { base = mix(base, vec3(0.55), 0.6); lit = -lit; }
      colour = vec4(base * (0.62 + 0.40 * max(lit, 0.0)), 1.0);
    }`);
  gl.linkProgram(program);
  gl.useProgram(program);
  const place = (name) => gl.getUniformLocation(program, name);
  const [viewAt, pullAt, inkAt, eyeAt, fadeAt, twoAt, plainAt] = ["view", "pull", "ink", "eye", "fade", "two", "plain"].map(place);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, bytesOf(film.colours));
  for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, key, gl.LINEAR);
  for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, key, gl.CLAMP_TO_EDGE);
  gl.enable(gl.DEPTH_TEST);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const ground = () => (dark.matches ? gl.clearColor(0.125, 0.137, 0.165, 1) : gl.clearColor(0.975, 0.973, 0.965, 1));
  ground();
  dark.addEventListener("change", () => { ground(); draw(); });
  const buffer = () => gl.createBuffer(), points = buffer(), normals = buffer(), shares = buffer();
  for (const piece of film.pieces) for (const shape of piece.topologies) {
    for (const [key, values] of [["indexBuffer", shape.index], ["edgeBuffer", shape.edge]]) {
      shape[key] = buffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, shape[key]);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, values, gl.STATIC_DRAW);
    }
  }
  for (const still of film.still) {
    still.indexBuffer = buffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, still.indexBuffer);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, still.index, gl.STATIC_DRAW);
  }
  const attribute = (slot, target, values, size, type, normalised) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, target);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, size, type, normalised, 0, 0);
  };
  function drawStill(still, eye) {
    const turned = camera.which === "all" && still.turned;
    attribute(0, points, turned || still.surface, 3, gl.FLOAT, false);
    attribute(1, normals, turned ? still.turnedNormals : still.normals, 3, gl.FLOAT, false);
    attribute(2, shares, still.shades, 1, gl.UNSIGNED_BYTE, true);
    gl.uniform3fv(eyeAt, eye);
    for (const place of [pullAt, fadeAt, twoAt]) gl.uniform1f(place, 0);
    gl.uniform4f(inkAt, 0, 0, 0, 0);
    gl.uniform4f(plainAt, ...still.colour, 1);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, still.indexBuffer);
    gl.drawElements(gl.TRIANGLES, still.index.length, gl.UNSIGNED_INT, 0);
    gl.uniform4f(plainAt, 0, 0, 0, 0);
  }
  function drawMesh(shape, position, normal, colours, eye) {
    attribute(0, points, position, 3, gl.FLOAT, false);
    if (normal) attribute(1, normals, normal, 3, gl.FLOAT, false);
    else { gl.disableVertexAttribArray(1); gl.vertexAttrib3f(1, 0, 0, 1); }
    attribute(2, shares, colours, 1, gl.UNSIGNED_BYTE, true);
    gl.uniform3fv(eyeAt, eye);
    gl.uniform1f(pullAt, 0);
    gl.uniform4f(inkAt, 0, 0, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, shape.indexBuffer);
    gl.drawElements(gl.TRIANGLES, shape.index.length, gl.UNSIGNED_INT, 0);
    gl.uniform1f(pullAt, 2e-4);
    gl.uniform4f(inkAt, 0.1, 0.11, 0.14, 1);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, shape.edgeBuffer);
    gl.drawElements(gl.LINES, shape.edge.length, gl.UNSIGNED_INT, 0);
  }

  // --- time: between two layouts of one topology there are blends of both
  const last = film.frames.length - 1;
  let now = 0, playing = false;
  function stateAt(piece, time) {
    const k = Math.min(Math.floor(time), last), next = film.frames[Math.min(k + 1, last)];
    const frame = film.frames[k] + (time - k) * (next - film.frames[k]);
    const after = piece.layouts.findIndex((layout) => layout.number > frame);
    const a = piece.layouts.at(after < 0 ? -1 : Math.max(after - 1, 0)), b = after < 0 ? a : piece.layouts[after];
    const share = after < 0 ? 0 : (frame - a.number) / (b.number - a.number);
    if (share <= 0 || b.shape !== a.shape) return a;
    const blended = (x, y, kind) => kind.from(x, (value, i) => value + share * (y[i] - value));
    return { shape: a.shape, points: blended(a.points, b.points, Float32Array), colours: blended(a.colours, b.colours, Uint8Array) };
  }

  // --- maps: how much longer the cloth is in space than in the pattern, along its threads; the grain runs up the pattern
  let map = "energy", picked = null;
  const strainScale = 0.05;
  function strains(piece, state, way) {
    const key = "strain" + way, shape = state.shape, p = shape.surface, q = state.points, t = shape.index;
    if (state[key]) return state[key];
    const sum = new Float32Array(p.length / 3), area = new Float32Array(p.length / 3);
    for (let i = 0; i < t.length; i += 3) {
      const [a, b, c] = [3 * t[i], 3 * t[i + 1], 3 * t[i + 2]];
      const [ux, uy, vx, vy] = [q[b] - q[a], q[b + 1] - q[a + 1], q[c] - q[a], q[c + 1] - q[a + 1]], twice = ux * vy - uy * vx;
      if (Math.abs(twice) < 1e-12) continue;
      const [g, h] = way === "warp" ? [-vx / twice, ux / twice] : [vy / twice, -uy / twice];
      let long = 0;
      for (let k = 0; k < 3; k++) long += (g * (p[b + k] - p[a + k]) + h * (p[c + k] - p[a + k])) ** 2;
      for (const corner of [a, b, c]) { sum[corner / 3] += (Math.sqrt(long) - 1) * Math.abs(twice); area[corner / 3] += Math.abs(twice); }
    }
    return (state[key] = sum.map((value, i) => value / (area[i] || 1)));
  }
  // Energies, pressures and gaps are bytes of their scale; strains go both ways.
  const bytes = (state) => map === "energy" ? state.colours : state.shape.maps[map];
  const shadesOf = (piece, state) => bytes(state)
    || Uint8Array.from(strains(piece, state, map), (e) => 127.5 + 127.5 * Math.min(1, Math.max(-1, e / strainScale)));
  // The cloth under a place of the screen: piece, its value in the present map. The nearest triangle counts.
  function under(x, y) {
    const m = matrix(), px = (2 * x) / canvas.clientWidth - 1, py = 1 - (2 * y) / canvas.clientHeight;
    let best = null, depth = 1e9;
    for (const piece of film.pieces) {
      const state = stateAt(piece, now), turned = camera.which === "all" && state.shape.turned, t = state.shape.index;
      const shown = [camera.which !== "pattern" && (turned || state.shape.surface), camera.which !== "surface" && state.points];
      for (const p of shown.filter(Boolean)) {
        const count = p.length / 3, sx = new Float32Array(count), sy = new Float32Array(count), sz = new Float32Array(count);
        for (let i = 0; i < count; i++) {
          const [u, v, w] = [p[3 * i], p[3 * i + 1], p[3 * i + 2]], d = m[3] * u + m[7] * v + m[11] * w + m[15];
          sx[i] = (m[0] * u + m[4] * v + m[8] * w + m[12]) / d;
          sy[i] = (m[1] * u + m[5] * v + m[9] * w + m[13]) / d;
          sz[i] = (m[2] * u + m[6] * v + m[10] * w + m[14]) / d;
        }
        for (let i = 0; i < t.length; i += 3) {
          const [a, b, c] = [t[i], t[i + 1], t[i + 2]];
          const twice = (sx[b] - sx[a]) * (sy[c] - sy[a]) - (sy[b] - sy[a]) * (sx[c] - sx[a]);
          if (!twice) continue;
          const f = ((px - sx[a]) * (sy[c] - sy[a]) - (py - sy[a]) * (sx[c] - sx[a])) / twice;
          const g = ((sx[b] - sx[a]) * (py - sy[a]) - (sy[b] - sy[a]) * (px - sx[a])) / twice;
          if (f < 0 || g < 0 || f + g > 1) continue;
          const z = sz[a] + f * (sz[b] - sz[a]) + g * (sz[c] - sz[a]);
          if (z >= depth) continue;
          depth = z;
          const from = bytes(state) || strains(piece, state, map);
          best = { piece, value: from[a] + f * (from[b] - from[a]) + g * (from[c] - from[a]) };
        }
      }
    }
    return best;
  }
  const wordsOf = (found) => {
    if (!found) return "";
    const name = found.piece.name.replaceAll("_", " ");
    if (map === "warp" || map === "weft") return `${name}: ${(100 * found.value).toFixed(1)} % along the ${map}`;
    const { high, unit } = film.maps[map] || { high: film.scale, unit: "J/m²" };
    return `${name}: ${found.value >= 254.5 ? "at least " : ""}${((found.value / 255) * high).toPrecision(3)} ${unit}`;
  };

  // --- camera
  const camera = { turn: 0, tilt: 0, away: 3, target: [0, 0, 0], which: "all", moved: false };
  function boxOf(which) {
    const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
    const grow = (p) => { for (let i = 0; i < p.length; i++) { low[i % 3] = Math.min(low[i % 3], p[i]); high[i % 3] = Math.max(high[i % 3], p[i]); } };
    if (which !== "pattern") for (const still of film.still) grow(still.surface);
    for (const piece of film.pieces) {
      if (which !== "pattern") grow(piece.topologies[0].surface);
      if (which !== "surface") for (const k of [0, -1]) grow(piece.layouts.at(k).points);
    }
    return [low, high];
  }
  function look(which, turn, tilt) {
    const [low, high] = boxOf(which), aspect = canvas.clientWidth / Math.max(canvas.clientHeight, 1);
    const size = [0, 1, 2].map((k) => high[k] - low[k]);
    const wide = Math.abs(Math.cos(turn)) * size[0] + Math.abs(Math.sin(turn)) * size[2];
    const deep = Math.abs(Math.sin(turn)) * size[0] + Math.abs(Math.cos(turn)) * size[2];
    camera.target = [0, 1, 2].map((k) => 0.5 * (low[k] + high[k]));
    camera.away = Math.max(wide / aspect, size[1]) * 1.12 / (2 * Math.tan(0.25)) + 0.5 * deep;
    Object.assign(camera, { turn, tilt, which, moved: false });
    draw();
  }
  function axes() {
    const [ct, st, cp, sp] = [Math.cos(camera.turn), Math.sin(camera.turn), Math.cos(camera.tilt), Math.sin(camera.tilt)];
    return { right: [ct, 0, -st], up: [-st * sp, cp, -ct * sp], back: [st * cp, sp, ct * cp] };
  }
  function matrix() {
    const { right, up, back } = axes(), near = camera.away / 50, far = camera.away * 20;
    const eye = camera.target.map((value, k) => value + camera.away * back[k]);
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const f = 1 / Math.tan(0.25), g = f / (canvas.width / canvas.height);
    const a = (far + near) / (near - far), b = (2 * far * near) / (near - far), m = new Float32Array(16);
    for (let k = 0; k < 3; k++) { m[4 * k] = g * right[k]; m[4 * k + 1] = f * up[k]; m[4 * k + 2] = a * back[k]; m[4 * k + 3] = -back[k]; }
    m[12] = -g * dot(right, eye); m[13] = -f * dot(up, eye); m[14] = -a * dot(back, eye) + b; m[15] = dot(back, eye);
    return m;
  }
  function draw() {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, canvas.clientWidth * ratio);
    canvas.height = Math.max(1, canvas.clientHeight * ratio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(viewAt, false, matrix());
    const { back } = axes();
    const bodyBox = document.getElementById("body");
    for (const still of camera.which === "pattern" ? [] : film.still) {
      if (still.kind !== "body" || (bodyBox && bodyBox.checked)) drawStill(still, back);
    }
    for (const piece of film.pieces) {
      const state = stateAt(piece, now);
      const shape = state.shape, turned = camera.which === "all" && shape.turned;
      const shades = shadesOf(piece, state);
      gl.uniform1f(fadeAt, picked && picked !== piece ? 1 : 0);
      gl.uniform1f(twoAt, bytes(state) ? 0 : 1);
      if (camera.which !== "pattern") drawMesh(shape, turned || shape.surface, turned ? shape.turnedNormals : shape.normals, shades, back);
      if (camera.which !== "surface") drawMesh(state.shape, state.points, null, shades, back);
    }
    const k = Math.min(Math.round(now), last);
    label.textContent = `${film.stages[k]} · frame ${film.frames[k]} of ${film.of}` + (film.computed[k] ? " · computed" : " · interpolated");
    slider.value = String(now);
  }
  function show(time) { now = Math.min(Math.max(time, 0), last); draw(); }

  // --- hands
  slider.max = String(last);
  slider.step = "any";
  slider.addEventListener("input", () => { halt(); show(Number(slider.value)); });
  let clock = 0;
  function halt() { playing = false; play.textContent = "Play"; }
  function tick(time) {
    if (!playing) return;
    const step = Number(document.getElementById("speed").value) * ((time - clock) / 1000) * film.rate * Math.max(film.frames.length / film.of, 0.01);
    clock = time;
    if (now >= last && !document.getElementById("loop").checked) { halt(); return; }
    show(now >= last ? 0 : now + step);
    requestAnimationFrame(tick);
  }
  play.addEventListener("click", () => {
    if (playing) { halt(); return; }
    playing = true;
    play.textContent = "Pause";
    if (now >= last) now = 0;
    clock = performance.now();
    requestAnimationFrame(tick);
  });
  const views = { all: ["all", 0, 0], front: ["surface", 0, 0.08], side: ["surface", Math.PI / 2, 0.08], back: ["surface", Math.PI, 0.08], pattern: ["pattern", 0, 0] };
  for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click", () => look(...views[button.dataset.view]));
  const bodyShown = document.getElementById("body");
  if (bodyShown) bodyShown.addEventListener("change", draw);
  const chosen = document.getElementById("map"), value = document.getElementById("value");
  const [lowEnd, highEnd, bar] = [document.getElementById("low"), document.getElementById("high"), document.querySelector(".scale i")];
  const energyEnds = lowEnd && [lowEnd.textContent, highEnd.textContent, bar.style.background];
  chosen.addEventListener("change", () => {
    map = chosen.value;
    if (lowEnd) {
      const of = film.maps[map];
      const ends = map === "energy" ? energyEnds
        : of ? ["0", `${of.high.toPrecision(3)} ${of.unit}`, energyEnds[2]]
        : [`-${100 * strainScale} %`, `+${100 * strainScale} %, longer in space than flat`, "linear-gradient(90deg,#2166ac,#f7f7f7,#b2182b)"];
      [lowEnd.textContent, highEnd.textContent, bar.style.background] = ends;
    }
    value.textContent = "";
    draw();
  });
  let pointed = null, pressed = null;
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) return;
    if (!pointed) requestAnimationFrame(() => { value.textContent = wordsOf(under(...pointed)); pointed = null; });
    pointed = [event.offsetX, event.offsetY];
  });
  canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
  canvas.addEventListener("click", (event) => {
    if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
    const found = under(event.offsetX, event.offsetY);
    picked = found && picked !== found.piece ? found.piece : null;
    value.textContent = wordsOf(found);
    draw();
  });
  const fingers = new Map();  // two of them zoom
  const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY); };
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, event); });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", () => look(...views.all));
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    camera.moved = true;
    const before = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, event);
    if (fingers.size === 2) {
      camera.away *= before / Math.max(spread(), 1);
    } else if (event.buttons === 1 && !event.shiftKey) {
      camera.turn -= event.movementX * 0.008;
      camera.tilt = Math.min(1.5, Math.max(-1.5, camera.tilt + event.movementY * 0.008));
    } else {
      const { right, up } = axes(), scale = (2 * camera.away * Math.tan(0.25)) / canvas.clientHeight;
      camera.target = camera.target.map((value, k) => value - scale * (event.movementX * right[k] - event.movementY * up[k]));
    }
    draw();
  });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;  // the page scrolls
    event.preventDefault();
    camera.moved = true;
    camera.away *= Math.exp(0.001 * event.deltaY);
    draw();
  }, { passive: false });
  window.addEventListener("resize", () => { if (camera.moved) draw(); else look(camera.which, camera.turn, camera.tilt); });
  window.addEventListener("keydown", (event) => {
    if (event.target.tagName === "SELECT") return;
    if (event.target !== slider && event.key === "ArrowRight") { halt(); show(Math.floor(now) + 1); }
    if (event.target !== slider && event.key === "ArrowLeft") { halt(); show(Math.ceil(now) - 1); }
    if (event.key === " " && event.target.tagName !== "BUTTON") { event.preventDefault(); play.click(); }
  });
  now = last;
  look(...views.all);
  // For scripts and tests: what is shown.
  window.review = { show, under: (x, y) => wordsOf(under(x, y)), picked: () => picked && picked.name, look: (name) => look(...views[name]), points: (name) => Array.from(stateAt(film.pieces.find((piece) => piece.name === name), now).points) };
  document.body.dataset.ready = "yes";
})();
