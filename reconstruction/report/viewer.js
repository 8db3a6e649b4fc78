// Viewer of the report: draws the models of #viewer-data with WebGL 2. No library, nothing is loaded.
"use strict";
(function () {
  const box = document.getElementById("viewer");
  if (!box) return;
  const $ = (name) => box.querySelector(name);
  const canvas = $("canvas"), said = $(".said"), legend = $(".legend");
  const data = JSON.parse(document.getElementById("viewer-data").textContent);
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const HOME = { yaw: -0.45, pitch: 0.12, zoom: 1, x: 0, y: 0 };
  const FIELD = 0.5; // tangent of half of the vertical angle of view, times two
  const view = Object.assign({}, HOME);
  const state = { model: data.models.length - 1, scalar: -1, lines: true, edges: false, figure: true, turning: false };
  let gl, surface, stroke, cache = [], backdrop = null, waiting = false, last = 0;

  const VERTEX = `#version 300 es
    precision highp float;
    in vec3 position; in vec3 normal; in float value;
    uniform vec3 low, size, centre; uniform mat3 turn; uniform vec4 lens; uniform vec3 shift; uniform float lift;
    out vec3 n; out float v; out float known;
    void main() {
      vec3 p = turn * (low + size * position - centre) + shift;
      n = turn * normal;
      known = value > 0.99999 ? 0.0 : 1.0;
      v = value * 65535.0 / 65534.0;
      gl_Position = vec4(p.x * lens.x, p.y * lens.y, p.z * lens.z + lens.w, -p.z);
      gl_Position.z -= lift * gl_Position.w;
    }`;
  const SHADED = `#version 300 es
    precision highp float;
    in vec3 n; in float v; in float known;
    uniform vec3 plain, inside, stops[17]; uniform bool coloured;
    out vec4 colour;
    void main() {
      vec3 m = normalize(n + vec3(0.0, 0.0, 1e-6));
      bool front = gl_FrontFacing;
      if (!front) m = -m;
      vec3 base = front ? plain : inside;
      if (coloured) {
        float s = clamp(v, 0.0, 1.0) * 16.0;
        int i = min(int(s), 15);
        base = known > 0.999 ? mix(stops[i], stops[i + 1], s - float(i)) : vec3(0.6);
      }
      float light = 0.38 + 0.62 * max(0.0, dot(m, normalize(vec3(-0.35, 0.45, 0.85))));
      colour = vec4(base * light, 1.0);
    }`;
  const FLAT = `#version 300 es
    precision highp float;
    in vec3 n; in float v; in float known;
    uniform vec3 plain; out vec4 colour;
    void main() { colour = vec4(plain, 1.0); }`;

  function program(fragment) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text.trim());
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    ["position", "normal", "value"].forEach((name, i) => gl.bindAttribLocation(made, i, name));
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(made));
    const at = {};
    for (const name of ["low", "size", "centre", "turn", "lens", "shift", "lift", "plain", "inside", "stops", "coloured"])
      at[name] = gl.getUniformLocation(made, name);
    return { made, at };
  }

  function bytes(text) {
    const raw = atob(text), out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out.buffer;
  }
  function buffer(array, kind) {
    const made = gl.createBuffer();
    gl.bindBuffer(kind || gl.ARRAY_BUFFER, made);
    gl.bufferData(kind || gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
    return made;
  }
  function normals(q, faces, size) {
    const sum = new Float32Array(q.length), sx = size[0], sy = size[1], sz = size[2];
    for (let f = 0; f < faces.length; f += 3) {
      const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
      const ux = (q[b] - q[a]) * sx, uy = (q[b + 1] - q[a + 1]) * sy, uz = (q[b + 2] - q[a + 2]) * sz;
      const vx = (q[c] - q[a]) * sx, vy = (q[c + 1] - q[a + 1]) * sy, vz = (q[c + 2] - q[a + 2]) * sz;
      const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
      for (const i of [a, b, c]) { sum[i] += x; sum[i + 1] += y; sum[i + 2] += z; }
    }
    const out = new Int8Array(4 * q.length / 3);
    for (let i = 0, k = 0; i < sum.length; i += 3, k += 4) {
      const scale = 127 / (Math.hypot(sum[i], sum[i + 1], sum[i + 2]) || 1);
      for (let j = 0; j < 3; j++) out[k + j] = Math.round(sum[i + j] * scale);
    }
    return out;
  }
  function loaded(m) {
    const q = new Uint16Array(bytes(m.positions)), faces = new (m.wide ? Uint32Array : Uint16Array)(bytes(m.triangles));
    const out = { low: m.low, size: m.size, n: faces.length, kind: m.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT, faces };
    out.position = buffer(q);
    out.normal = buffer(normals(q, faces, m.size));
    out.index = buffer(faces, gl.ELEMENT_ARRAY_BUFFER);
    out.values = (m.scalars || []).map((s) => buffer(new Uint16Array(bytes(s.values))));
    if (m.lines) out.lines = { low: m.lines.low, size: m.lines.size, n: m.lines.n, position: buffer(new Uint16Array(bytes(m.lines.ends))) };
    return out;
  }
  function edges(g) {
    if (!g.edges) {
      const out = new g.faces.constructor(2 * g.n);
      for (let f = 0, k = 0; f < g.n; f += 3)
        for (let i = 0; i < 3; i++) { out[k++] = g.faces[f + i]; out[k++] = g.faces[f + (i + 1) % 3]; }
      g.edges = buffer(out, gl.ELEMENT_ARRAY_BUFFER);
    }
    return g.edges;
  }

  function point(g, normal, value) {
    [[0, g.position, 3, gl.UNSIGNED_SHORT, 6], [1, normal, 3, gl.BYTE, 4], [2, value, 1, gl.UNSIGNED_SHORT, 2]].forEach(([i, b, n, t, s]) => {
      if (!b) { gl.disableVertexAttribArray(i); gl.vertexAttrib4f(i, 0, 0, 0, 1); return; }
      gl.bindBuffer(gl.ARRAY_BUFFER, b);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, n, t, true, s, 0);
    });
  }
  function use(p, g, m, lift, plain) {
    const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw), cp = Math.cos(view.pitch), sp = Math.sin(view.pitch);
    // world: x right, y away, z up; rows of the turn are the picture's right, up and towards the viewer
    const turn = [cy, -sp * sy, cp * sy, sy, sp * cy, -cp * cy, 0, cp, sp];
    const far = (1.15 * m.radius / (FIELD / 2) / view.zoom), aspect = canvas.width / canvas.height, f = 2 / FIELD;
    const distance = aspect < 0.8 ? far / Math.max(aspect, 0.3) * 0.8 : far;
    const near = Math.max(distance - 2.5 * m.radius, 0.02 * m.radius), end = distance + 2.5 * m.radius;
    gl.useProgram(p.made);
    gl.uniform3fv(p.at.low, g.low); gl.uniform3fv(p.at.size, g.size); gl.uniform3fv(p.at.centre, m.centre);
    gl.uniformMatrix3fv(p.at.turn, false, turn);
    gl.uniform4f(p.at.lens, f / aspect, f, -(end + near) / (end - near), -2 * end * near / (end - near));
    gl.uniform3f(p.at.shift, view.x * m.radius, view.y * m.radius, -distance);
    gl.uniform1f(p.at.lift, lift);
    gl.uniform3fv(p.at.plain, plain);
  }
  function css(name) {
    const text = getComputedStyle(box).getPropertyValue(name).trim(), n = parseInt(text.slice(1), 16);
    return [(n >> 16) / 255, ((n >> 8) & 255) / 255, (n & 255) / 255];
  }
  function draw(now) {
    waiting = false;
    if (!gl || gl.isContextLost()) return;
    if (state.turning) { view.yaw += Math.min(0.05, (now - last) / 1000 * 0.6); last = now; again(); }
    const m = data.models[state.model], g = cache[state.model] || (cache[state.model] = loaded(m));
    gl.viewport(0, 0, canvas.width, canvas.height);
    const back = css("--stage");
    gl.clearColor(back[0], back[1], back[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    if (data.backdrop && state.figure) {
      backdrop = backdrop || loaded(data.backdrop);
      triangles(backdrop, m, css("--body"), css("--body"), null);
    }
    const chosen = state.scalar >= 0 && m.scalars[state.scalar] ? g.values[state.scalar] : null;
    triangles(g, m, css("--cloth"), css("--inside"), chosen);
    if (state.edges) {
      use(stroke, g, m, 0.0004, css("--edge"));
      point(g, null, null);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, edges(g));
      gl.drawElements(gl.LINES, 2 * g.n, g.kind, 0);
    }
    if (g.lines && state.lines) {
      use(stroke, g.lines, m, 0.0008, css(chosen ? "--stroke-light" : "--stroke"));
      point(g.lines, null, null);
      gl.drawArrays(gl.LINES, 0, g.lines.n);
    }
    box.dataset.drawn = String(Number(box.dataset.drawn || 0) + 1);
  }
  function triangles(g, m, plain, inside, value) {
    use(surface, g, m, 0, plain);
    gl.uniform3fv(surface.at.inside, inside);
    gl.uniform1i(surface.at.coloured, value ? 1 : 0);
    gl.uniform3fv(surface.at.stops, data.colours.flat());
    point(g, g.normal, value);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, g.index);
    gl.drawElements(gl.TRIANGLES, g.n, g.kind, 0);
  }
  function again() { if (!waiting) { waiting = true; requestAnimationFrame(draw); } }

  function number(x) { return String(Number(x.toPrecision(3))); }
  function describe() {
    const m = data.models[state.model], s = m.scalars[state.scalar];
    legend.hidden = !s;
    if (s) {
      legend.querySelector(".name").textContent = s.label + (s.unit ? ", " + s.unit : "") + (s.gaps ? " (grey: no value)" : "");
      legend.querySelector(".low").textContent = (s.below ? "≤ " : "") + number(s.low);
      legend.querySelector(".high").textContent = (s.above ? "≥ " : "") + number(s.high);
    }
    $(".lines").hidden = !m.lines;
    $(".lines span").textContent = m.lines_label;
    said.textContent = m.name + ": " + m.all_faces.toLocaleString("en") + " triangles" +
      (s ? ", coloured by " + s.label : "") + (m.note ? ". " + m.note : "");
    again();
  }
  function choose(index) {
    const wanted = state.scalar >= 0 ? data.models[state.model].scalars[state.scalar].label : null;
    state.model = index;
    const scalars = data.models[index].scalars, list = $("select");
    list.replaceChildren(...["shape only", ...scalars.map((s) => s.label)].map((t, i) => new Option(t, String(i - 1))));
    const found = scalars.findIndex((s) => s.label === wanted);
    state.scalar = wanted === null ? -1 : found;
    list.value = String(state.scalar);
    $(".colours").hidden = !scalars.length;
    describe();
  }
  function move(dx, dy, pan) {
    if (pan) { view.x += 2 * dx / view.zoom; view.y -= 2 * dy / view.zoom; }
    else { view.yaw -= 4 * dx; view.pitch = Math.max(-1.55, Math.min(1.55, view.pitch + 4 * dy)); }
    again();
  }
  function zoom(factor) { view.zoom = Math.max(0.4, Math.min(25, view.zoom * factor)); again(); }
  function turning(on) {
    state.turning = on && !still.matches;
    $(".turn").setAttribute("aria-pressed", String(state.turning));
    last = performance.now();
    again();
  }
  function act(name) {
    if (name === "reset") { turning(false); Object.assign(view, HOME); again(); }
    if (name === "front" || name === "side" || name === "back") {
      turning(false); view.pitch = 0; view.yaw = { front: 0, side: Math.PI / 2, back: Math.PI }[name]; again();
    }
    if (name === "closer") zoom(1.25);
    if (name === "further") zoom(0.8);
    if (name === "turn") turning(!state.turning);
  }

  function listen() {
    const held = new Map();
    canvas.addEventListener("pointerdown", (e) => { turning(false); held.set(e.pointerId, [e.clientX, e.clientY]); canvas.setPointerCapture(e.pointerId); });
    canvas.addEventListener("pointermove", (e) => {
      const old = held.get(e.pointerId);
      if (!old) return;
      const h = canvas.clientHeight, step = [(e.clientX - old[0]) / h, (e.clientY - old[1]) / h];
      if (held.size === 2) {
        const other = [...held].find(([id]) => id !== e.pointerId)[1];
        const before = Math.hypot(old[0] - other[0], old[1] - other[1]), after = Math.hypot(e.clientX - other[0], e.clientY - other[1]);
        if (before > 10) zoom(after / before);
        move(step[0] / 4, step[1] / 4, true);
      } else move(step[0], step[1], e.shiftKey || (e.buttons & 6) !== 0);
      held.set(e.pointerId, [e.clientX, e.clientY]);
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) canvas.addEventListener(name, (e) => held.delete(e.pointerId));
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => {
      if (document.activeElement !== canvas && !e.ctrlKey) return; // the page scrolls until the model is chosen
      e.preventDefault();
      zoom(Math.exp(-e.deltaY * (e.deltaMode ? 0.05 : 0.0015)));
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
      const what = { "+": "closer", "=": "closer", "-": "further", Home: "reset", 0: "reset" }[e.key];
      if (e.altKey || e.ctrlKey || e.metaKey || !(way || what)) return;
      e.preventDefault();
      if (way) move(0.04 * way[0], 0.04 * way[1], e.shiftKey); else act(what);
    });
    box.addEventListener("click", (e) => { const b = e.target.closest("button"); if (b) act(b.dataset.do); });
    box.addEventListener("change", (e) => {
      const t = e.target;
      if (t.name === "model") choose(Number(t.value));
      else if (t.tagName === "SELECT") { state.scalar = Number(t.value); describe(); }
      else { state[t.name] = t.checked; again(); }
    });
    canvas.addEventListener("webglcontextlost", (e) => e.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { cache = []; backdrop = null; prepare(); again(); });
    still.addEventListener("change", () => { $(".turn").hidden = still.matches; turning(false); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
    new ResizeObserver(() => {
      const ratio = Math.min(2, devicePixelRatio || 1);
      canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
      canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
      again();
    }).observe(canvas);
  }
  function prepare() { surface = program(SHADED); stroke = program(FLAT); }

  try {
    gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: false });
    if (!gl) throw new Error("this browser offers no WebGL 2");
    prepare();
    cache[state.model] = loaded(data.models[state.model]);
    const stops = data.colours.map((c) => "rgb(" + c.map((x) => Math.round(255 * x)).join(",") + ")");
    legend.querySelector(".bar").style.background = "linear-gradient(to right," + stops.join(",") + ")";
    $(".turn").hidden = still.matches;
    box.classList.add("live");
    listen();
    choose(state.model);
  } catch (error) {
    $(".why").textContent = "The model cannot be turned here: " + error.message + ".";
  }
})();
