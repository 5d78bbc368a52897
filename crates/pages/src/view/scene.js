// A world on a canvas: boxes, spheres and cylinders in 3-D, seen by a camera that a person turns. `bodies()` are what there is, each with
// form, size and colour; `placeOf(body)` is its place now, x, y, z and a quaternion; `keys` are keys besides those of the camera.
const scrnnScene = (canvas, bodies, placeOf, keys) => {
  "use strict";
  // Matrices are lists of columns, as WebGL wants them.
  const times4 = (a, b) => {
    const out = new Float64Array(16);
    for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++) for (let k = 0; k < 4; k++) out[4 * j + i] += a[4 * k + i] * b[4 * j + k];
    return out;
  };
  const minus = (a, b) => a.map((value, k) => value - b[k]);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
  const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));

  // The camera circles a target; up is z.
  const aspectOf = () => canvas.clientWidth / canvas.clientHeight || 1;
  const camera = { turn: 0.5, tilt: 0.35, distance: 2, target: [0, 0, 0], angle: 0.7 };
  const eyeOf = () => {
    const { turn, tilt, distance, target } = camera;
    const way = [Math.cos(tilt) * Math.cos(turn), Math.cos(tilt) * Math.sin(turn), Math.sin(tilt)];
    return target.map((value, k) => value + distance * way[k]);
  };
  const seen = () => {
    const eye = eyeOf(), back = unit(minus(eye, camera.target)), right = unit(cross([0, 0, 1], back)), up = cross(back, right);
    const view = new Float64Array([right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right, eye), -dot(up, eye), -dot(back, eye), 1]);
    const near = camera.distance / 100, far = camera.distance * 100, aspect = aspectOf();
    // The angle is that of the shorter side, so that what fits on a screen fits on a phone.
    const wide = Math.min(1, aspect) / Math.tan(camera.angle / 2);
    const lens = new Float64Array([wide / aspect, 0, 0, 0, 0, wide, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
    return { all: times4(lens, view), right, up, eye };
  };
  // Where a place in the world is on the canvas, in pixels of the page from its upper left corner.
  const project = ([x, y, z]) => {
    const m = seen().all, row = (k) => m[k] * x + m[4 + k] * y + m[8 + k] * z + m[12 + k], w = row(3);
    return [((row(0) / w + 1) / 2) * canvas.clientWidth, ((1 - row(1) / w) / 2) * canvas.clientHeight];
  };

  const matrixOf = ([x, y, z, i, j, k, w], [a, b, c]) => [
    a * (1 - 2 * (j * j + k * k)), a * 2 * (i * j + k * w), a * 2 * (i * k - j * w), 0,
    b * 2 * (i * j - k * w), b * (1 - 2 * (i * i + k * k)), b * 2 * (j * k + i * w), 0,
    c * 2 * (i * k + j * w), c * 2 * (j * k - i * w), c * (1 - 2 * (i * i + j * j)), 0, x, y, z, 1];

  // Forms of size 1: corners with their normals, in triangles.
  const form = (triangles) => new Float32Array(triangles.flat(2));
  const box = () => {
    const out = [];
    for (let axis = 0; axis < 3; axis++) for (const side of [-0.5, 0.5]) {
      const corner = (u, v) => { const p = [0, 0, 0], n = [0, 0, 0]; p[axis] = side; n[axis] = 2 * side; p[(axis + 1) % 3] = u; p[(axis + 2) % 3] = v; return [p, n]; };
      const [a, b, c, d] = [corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
      out.push(...a, ...b, ...c, ...a, ...c, ...d);
    }
    return form(out);
  };
  const sphere = () => {
    const out = [], rows = 16, columns = 24;
    const corner = (i, j) => {
      const up = (Math.PI * i) / rows, around = (2 * Math.PI * j) / columns;
      const n = [Math.sin(up) * Math.cos(around), Math.sin(up) * Math.sin(around), Math.cos(up)];
      return [n.map((value) => value / 2), n];
    };
    for (let i = 0; i < rows; i++) for (let j = 0; j < columns; j++) {
      const [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
      out.push(...a, ...b, ...c, ...a, ...c, ...d);
    }
    return form(out);
  };
  const cylinder = () => {
    const out = [], columns = 32;
    for (let j = 0; j < columns; j++) {
      const rim = (k, z, normal) => { const a = (2 * Math.PI * k) / columns; return [[Math.cos(a) / 2, Math.sin(a) / 2, z], normal || [Math.cos(a), Math.sin(a), 0]]; };
      out.push(...rim(j, -0.5), ...rim(j + 1, -0.5), ...rim(j + 1, 0.5), ...rim(j, -0.5), ...rim(j + 1, 0.5), ...rim(j, 0.5));
      for (const z of [-0.5, 0.5]) out.push([0, 0, z], [0, 0, 2 * z], ...rim(j, z, [0, 0, 2 * z]), ...rim(j + 1, z, [0, 0, 2 * z]));
    }
    return form(out);
  };

  const gl = canvas.getContext("webgl", { antialias: true });
  let shader = null;
  if (gl) {
    const compile = (kind, text) => { const one = gl.createShader(kind); gl.shaderSource(one, text); gl.compileShader(one); return one; };
    const program = gl.createProgram();
    gl.attachShader(program, compile(gl.VERTEX_SHADER, "attribute vec3 at,normal;uniform mat4 seen,place;uniform vec3 size;varying vec3 n;" +
      "void main(){gl_Position=seen*place*vec4(at,1.);n=mat3(place)*(normal/(size*size));}"));
    gl.attachShader(program, compile(gl.FRAGMENT_SHADER, "precision mediump float;uniform vec3 colour,light;uniform float flat_;varying vec3 n;" +
      "void main(){float d=dot(normalize(n),light);gl_FragColor=vec4(mix(colour*(.62+.38*d),colour,flat_),1.);}"));
    gl.linkProgram(program);
    gl.useProgram(program);
    const buffers = {};
    for (const [name, corners] of [["box", box()], ["sphere", sphere()], ["cylinder", cylinder()]]) {
      buffers[name] = { buffer: gl.createBuffer(), count: corners.length / 6 };
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name].buffer);
      gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    }
    const uniform = (name) => gl.getUniformLocation(program, name);
    shader = { buffers, at: gl.getAttribLocation(program, "at"), normal: gl.getAttribLocation(program, "normal"),
      seen: uniform("seen"), place: uniform("place"), size: uniform("size"), colour: uniform("colour"), light: uniform("light"), flat: uniform("flat_") };
    gl.enableVertexAttribArray(shader.at);
    gl.enableVertexAttribArray(shader.normal);
    gl.enable(gl.DEPTH_TEST);
  }

  // Draws all bodies, or those of one kind in white on black.
  const paint = (only) => {
    if (!shader) return;
    const dense = Math.min(window.devicePixelRatio || 1, 2);
    const [wide, high] = [Math.round(canvas.clientWidth * dense), Math.round(canvas.clientHeight * dense)];
    if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
    gl.viewport(0, 0, wide, high);
    const paper = getComputedStyle(canvas).backgroundColor.match(/[\d.]+/g).map((value) => value / 255);
    if (only) gl.clearColor(0, 0, 0, 1); else gl.clearColor(paper[0], paper[1], paper[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const { all, right, up, eye } = seen();
    const back = unit(minus(eye, camera.target));
    gl.uniformMatrix4fv(shader.seen, false, new Float32Array(all));
    gl.uniform3fv(shader.light, unit(back.map((value, k) => value + 0.5 * up[k] + 0.35 * right[k])));
    gl.uniform1f(shader.flat, only ? 1 : 0);
    for (const body of bodies()) {
      if (only && !only(body)) continue;
      const place = placeOf(body);
      if (!place) continue;
      const { buffer, count } = shader.buffers[body.form];
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.vertexAttribPointer(shader.at, 3, gl.FLOAT, false, 24, 0);
      gl.vertexAttribPointer(shader.normal, 3, gl.FLOAT, false, 24, 12);
      gl.uniformMatrix4fv(shader.place, false, new Float32Array(matrixOf(place, body.size)));
      gl.uniform3fv(shader.size, body.size);
      gl.uniform3fv(shader.colour, only ? [1, 1, 1] : body.colour);
      gl.drawArrays(gl.TRIANGLES, 0, count);
    }
  };
  // Where a body is drawn: the middle of its pixels, whatever stands before it.
  const measure = (name, form) => {
    paint((body) => body.name === name && (!form || body.form === form));
    const pixels = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    let [x, y, sum] = [0, 0, 0];
    for (let k = 0; k < canvas.width * canvas.height; k++) {
      const weight = pixels[4 * k] / 255;
      if (weight) { x += weight * ((k % canvas.width) + 0.5); y += weight * (Math.floor(k / canvas.width) + 0.5); sum += weight; }
    }
    paint();
    return sum ? { at: [((x / sum) * canvas.clientWidth) / canvas.width, canvas.clientHeight * (1 - y / sum / canvas.height)], pixels: sum } : null;
  };

  // All of these places, and what is near them, is in view.
  const home = (places) => {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const place of places) for (let axis = 0; axis < 3; axis++) {
      low[axis] = Math.min(low[axis], place[axis]);
      high[axis] = Math.max(high[axis], place[axis]);
    }
    if (low[0] > high[0]) return;
    camera.target = low.map((value, axis) => (value + high[axis]) / 2);
    camera.distance = Math.max(0.5, 1.5 * Math.hypot(...minus(high, low)) + 0.3);
    Object.assign(camera, { turn: 0.5, tilt: 0.35 });
  };

  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, event); });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  const move = (x, y) => {
    const { right, up } = seen(), step = (2 * camera.distance * Math.tan(camera.angle / 2)) / (canvas.clientHeight * Math.min(1, aspectOf()));
    camera.target = camera.target.map((value, k) => value + step * (y * up[k] - x * right[k]));
  };
  canvas.addEventListener("pointermove", (event) => {
    const old = fingers.get(event.pointerId);
    if (!old) return;
    const [x, y] = [event.clientX - old.clientX, event.clientY - old.clientY];
    if (fingers.size > 1) {
      const [other] = [...fingers.values()].filter((one) => one.pointerId !== event.pointerId);
      const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY) || 1;
      camera.distance *= apart(old) / apart(event);
    } else if (event.buttons & 2 || event.shiftKey) move(x, y);
    else turn(-0.008 * x, 0.008 * y);
    fingers.set(event.pointerId, event);
    paint();
  });
  const turn = (around, over) => { camera.turn += around; camera.tilt = Math.min(1.5, Math.max(-1.5, camera.tilt + over)); };
  const nearer = (factor) => { camera.distance = Math.min(1e4, Math.max(0.02, camera.distance * factor)); };
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); nearer(Math.exp(0.001 * event.deltaY)); paint(); }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const act = { ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1), "+": () => nearer(0.9), "-": () => nearer(1.1), ...keys }[event.key];
    if (act) { event.preventDefault(); act(); paint(); }
  });
  window.addEventListener("resize", () => paint());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => paint());
  return { works: Boolean(gl), camera, project, measure, paint, home };
};
// Places of bodies as they come in a page: numbers of four bytes, as text.
const scrnnFloats = (text) => new Float32Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
// What lies between two places, in proportion.
const scrnnBetween = (a, b, share) => {
  const sign = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6] < 0 ? -1 : 1;
  const out = Array.from(a, (value, k) => value + share * ((k > 2 ? sign : 1) * b[k] - value));
  const length = Math.hypot(out[3], out[4], out[5], out[6]) || 1;
  return out.map((value, k) => (k > 2 ? value / length : value));
};
