"""Script of the page that draws fewer pixels and triangles while something moves, where software draws.

A page that stands still has the pixels of the screen and all triangles. viser itself lowers the resolution
once pictures come slowly, by a quarter, and raises it again after seconds.
"""

from __future__ import annotations

import json

MOVING = 0.5
"""Pixels of the picture along each side for a pixel of the page, while something moves."""

STILL_AFTER = 0.3
"""Time without a motion after which the picture is whole [s]."""

_CHECKS = 3
"""Number of checks, one after another, that must find no motion: a page that is slow draws between them."""

CELL = 5.0
"""Largest size of the cells in which the vertices of a shape become one, while something moves, in pixels of
the picture."""

TRIANGLES = 12_000
"""Number of triangles of coarse shapes in a picture, while something moves, above which the cells of the
heavy ones grow. A triangle takes software about a microsecond, however small it is."""

_COARSEST = 3
"""Largest number of times by which cells grow, by the root of two."""

_HEAVY = 300
"""Number of triangles of a coarse shape above which its cells may grow."""

_LIGHT = 200
"""Number of triangles up to which a shape is always drawn whole."""

_LEVELS = 8
"""Power of two by which the smallest cells divide the diagonal of a shape; there are two sizes a power."""

_SAVED = 0.7
"""Share of the triangles of a shape above which coarser ones are not drawn instead."""

ALWAYS_WHOLE = """
  const noteMotion = () => {}, noteMessage = () => {}, watchCamera = () => {};
  const drawCoarsely = () => {}, drawWhole = () => {}, levelWhileMoving = () => Infinity;
"""
"""Part of the script of a page that draws whole pictures, whose resolution viser chooses."""

COARSE_WHILE_MOVING = (
    f"const MOVING = {json.dumps(MOVING)}, CHECK_AFTER = {round(1e3 * STILL_AFTER / _CHECKS)};"
    f"const CHECKS = {_CHECKS}, CELL = {CELL}, LIGHT = {_LIGHT}, LEVELS = {_LEVELS}, SAVED = {_SAVED};"
    f"const TRIANGLES = {TRIANGLES}, COARSEST = {_COARSEST}, HEAVY = {_HEAVY};"
    + """
  const context = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    const cheap = {...options, antialias: false, preserveDrawingBuffer: false};
    return context.call(this, kind, kind.startsWith("webgl") ? cheap : options);
  };
  let waiting = false, quiet = 0, view = null, seen = false, begun = false;
  const stateOfPicture = () => window.__viserMutable?.scene?.__r3f?.root?.getState?.();
  // Programs are told the size of the whole picture, also while it has fewer pixels.
  const tellWholeSize = (page) => {
    let send = page.sendMessage;
    const sendSized = (message) => {
      if (message.type !== "ViewerCameraMessage") return send(message);
      const {clientWidth, clientHeight} = page.canvas;
      return send({...message, image_width: clientWidth, image_height: clientHeight});
    };
    Object.defineProperty(page, "sendMessage", {
      get: () => send && sendSized,
      set: (given) => { send = given; },
    });
  };
  let setRatio = null;
  const setResolution = (ratio) => {
    const state = stateOfPicture();
    if (!state) return;
    // viser sets its own ratio whenever it lays out its page, and where pictures come slowly.
    if (!setRatio) {
      setRatio = state.setDpr;
      window.__viserMutable.scene.__r3f.root.setState({setDpr: () => {}});
      tellWholeSize(window.__viserMutable);
    }
    if (state.viewport.dpr === ratio) return;
    setRatio(ratio);
    window.__viserMutable.requestRender?.();
  };
  const check = () => {
    quiet += 1;
    waiting = quiet < CHECKS;
    if (waiting) setTimeout(check, CHECK_AFTER);
    else setResolution(1);
  };
  // A picture that a program wants is whole.
  const isWanted = ({type}) => type === "GetRenderRequestMessage";
  const noteMessage = (message) => { if (isWanted(message)) setResolution(1); };
  const noteMotion = () => {
    const page = window.__viserMutable;
    // What is placed for the first time has not moved, nor has the camera.
    if (!begun) return;
    quiet = 0;
    if (page?.getRenderRequestState === "ready" && !page.messageQueue.some(isWanted)) setResolution(MOVING);
    if (waiting) return;
    waiting = true;
    setTimeout(check, CHECK_AFTER);
  };
  const watchCamera = (camera) => {
    if (window.__viserMutable.cameraControl?.camera !== camera) return;
    const now = camera.matrixWorld.elements.map((each) => Math.fround(each)).join();
    // A picture that is being drawn keeps its size.
    if (begun && view !== null && now !== view) setTimeout(noteMotion);
    view = now;
  };
  // All vertices of a shape in one cell are at one place; those that face different ways stay apart.
  const coarser = (geometry, cell) => {
    const {position, normal} = geometry.attributes, index = geometry.index, count = position.count;
    const {min} = geometry.boundingBox, cells = new Map(), vertices = new Map();
    const at = new Uint32Array(count), of = new Uint32Array(count), places = [], points = [], normals = [];
    for (let k = 0; k < count; k++) {
      const x = position.getX(k), y = position.getY(k), z = position.getZ(k);
      const key = Math.floor((x - min.x) / cell) + 1024 * (Math.floor((y - min.y) / cell)
        + 1024 * Math.floor((z - min.z) / cell));
      let place = cells.get(key);
      if (place === undefined) { cells.set(key, place = cells.size); places.push(0, 0, 0, 0); }
      places[4 * place] += x; places[4 * place + 1] += y; places[4 * place + 2] += z;
      places[4 * place + 3] += 1;
      at[k] = place;
      const a = normal.getX(k), b = normal.getY(k), c = normal.getZ(k);
      const faces = Math.round(a) + 1 + 3 * (Math.round(b) + 1) + 9 * (Math.round(c) + 1);
      let vertex = vertices.get(27 * place + faces);
      if (vertex === undefined) {
        vertices.set(27 * place + faces, vertex = vertices.size);
        normals.push(a, b, c);
        points.push(place, 0, 0);
      }
      of[k] = vertex;
    }
    for (let k = 0; k < points.length; k += 3) {
      const from = 4 * points[k], share = 1 / places[from + 3];
      for (let axis = 0; axis < 3; axis++) points[k + axis] = places[from + axis] * share;
    }
    const faces = [], known = new Set(), total = index ? index.count : count, size = cells.size;
    for (let k = 0; k + 2 < total; k += 3) {
      const corners = [0, 1, 2].map((j) => index ? index.getX(k + j) : k + j);
      const [a, b, c] = corners.map((j) => at[j]);
      if (a === b || b === c || c === a) continue;
      const key = a < b && a < c ? (a * size + b) * size + c
        : b < c ? (b * size + c) * size + a : (c * size + a) * size + b;
      if (known.has(key)) continue;
      known.add(key);
      faces.push(...corners.map((j) => of[j]));
    }
    if (faces.length > SAVED * total) return geometry;
    const Attribute = position.constructor, found = new geometry.constructor();
    found.setAttribute("position", new Attribute(new Float32Array(points), 3));
    found.setAttribute("normal", new Attribute(new Float32Array(normals), 3));
    found.setIndex(faces);
    found.boundingBox = geometry.boundingBox;
    found.boundingSphere = geometry.boundingSphere;
    return found;
  };
  // The normal of each triangle is that of its last corner; others share the corner where they end elsewhere.
  const faceted = (geometry) => {
    const {position} = geometry.attributes, index = geometry.index;
    const total = (index ?? position).count, used = new Uint8Array(position.count);
    const corners = new Uint32Array(total - total % 3), added = [];
    const normals = new Float32Array(3 * (position.count + total / 3));
    const at = (k) => [position.getX(k), position.getY(k), position.getZ(k)];
    for (let k = 0; k < corners.length; k += 3) {
      let face = [0, 1, 2].map((j) => index ? index.getX(k + j) : k + j);
      const last = face.findIndex((each) => !used[each]);
      const [[a, b, c], [d, e, f], [g, h, i]] = face.map(at);
      const x = (e - b) * (i - c) - (f - c) * (h - b), y = (f - c) * (g - a) - (d - a) * (i - c);
      const z = (d - a) * (h - b) - (e - b) * (g - a), length = Math.hypot(x, y, z) || 1;
      if (last < 0) {
        added.push(face[2]);
        face[2] = position.count + added.length - 1;
      } else {
        face = [face[(last + 1) % 3], face[(last + 2) % 3], face[last]];
        used[face[2]] = 1;
      }
      normals.set([x / length, y / length, z / length], 3 * face[2]);
      corners.set(face, k);
    }
    const count = position.count + added.length, points = new Float32Array(3 * count);
    for (let k = 0; k < count; k++)
      points.set(at(k < position.count ? k : added[k - position.count]), 3 * k);
    const Attribute = position.constructor, found = new geometry.constructor();
    found.setAttribute("position", new Attribute(points, 3));
    found.setAttribute("normal", new Attribute(normals.subarray(0, 3 * count), 3));
    found.setIndex(new Attribute(corners, 1));
    found.boundingBox = geometry.boundingBox;
    found.boundingSphere = geometry.boundingSphere;
    return found;
  };
  const facets = new WeakMap();
  const facetsOf = (geometry) => {
    if (!facets.has(geometry)) facets.set(geometry, faceted(geometry));
    return facets.get(geometry);
  };
  const levels = new WeakMap();
  // Copies, colours that vary and shaders of others stay as they are.
  const isPlain = (mesh) => {
    const {material, geometry} = mesh;
    return material.isMeshStandardMaterial && !material.map && !material.vertexColors
      && !Object.hasOwn(material, "onBeforeCompile") && geometry.attributes.normal
      && mesh.instancesCount === undefined && !mesh.isInstancedMesh && !mesh.isSkinnedMesh;
  };
  const isMoving = (camera) => {
    const state = stateOfPicture();
    return state?.viewport.dpr === MOVING && state.camera === camera;
  };
  let coarseness = 0;
  const adjustCoarseness = (triangles) => {
    // A cell that is larger by the root of two has half the triangles.
    if (triangles > TRIANGLES)
      coarseness = Math.min(coarseness + Math.ceil(Math.log2(triangles / TRIANGLES)), COARSEST);
    else if (triangles < 0.4 * TRIANGLES) coarseness = Math.max(coarseness - 1, 0);
  };
  // The power of two, or of its root, that divides the diagonal of a shape into cells.
  const levelOf = (mesh, camera, height) => {
    const {geometry} = mesh;
    if (!geometry.boundingSphere) geometry.computeBoundingSphere();
    if (!geometry.boundingBox) geometry.computeBoundingBox();
    const {center, radius} = geometry.boundingSphere, {min, max} = geometry.boundingBox;
    const scale = mesh.matrixWorld.getMaxScaleOnAxis();
    const away = center.clone().applyMatrix4(mesh.matrixWorld).distanceTo(camera.position) - scale * radius;
    const pixel = 2 * Math.max(away, camera.near) * Math.tan(0.5 * camera.fov * Math.PI / 180) / height;
    return Math.max(Math.ceil(2 * Math.log2(scale * min.distanceTo(max) / (CELL * pixel))), 2) / 2;
  };
  const levelWhileMoving = (mesh, renderer, camera) =>
    isMoving(camera) ? levelOf(mesh, camera, renderer.domElement.height) - 0.5 * coarseness : Infinity;
  const coarserFor = (mesh, camera, height) => {
    const {geometry} = mesh;
    if (!((geometry.index ?? geometry.attributes.position).count / 3 > LIGHT)) return geometry;
    const level = levelOf(mesh, camera, height);
    if (!(level <= LEVELS)) return geometry;
    if (!levels.has(geometry)) levels.set(geometry, new Map());
    const found = levels.get(geometry), {min, max} = geometry.boundingBox;
    const at = (level) => {
      if (!found.has(level)) found.set(level, coarser(geometry, min.distanceTo(max) / 2 ** level));
      return found.get(level);
    };
    const coarse = at(level);
    const isHeavy = coarseness > 0 && (coarse.index ?? coarse.attributes.position).count / 3 > HEAVY;
    return isHeavy ? at(Math.max(level - 0.5 * coarseness, 1)) : coarse;
  };
  // A matte surface takes a third of the time of one with gloss, and less where the light is that of its
  // corners. The colours of corners are those of the screen, as pixels between them need no powers then.
  const LIT = `
    #include <common>
    #include <lights_pars_begin>
    uniform vec3 diffuse;
    vec3 lit(vec3 n) {
      vec3 light = ambientLightColor;
      #if NUM_DIR_LIGHTS > 0
        for (int k = 0; k < NUM_DIR_LIGHTS; k++)
          light += max(dot(n, directionalLights[k].direction), 0.0) * directionalLights[k].color;
      #endif
      #if NUM_HEMI_LIGHTS > 0
        for (int k = 0; k < NUM_HEMI_LIGHTS; k++)
          light += getHemisphereLightIrradiance(hemisphereLights[k], n);
      #endif
      vec3 linear = clamp(RECIPROCAL_PI * diffuse * light, 0.0, 1.0);
      vec3 curved = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
      return mix(curved, 12.92 * linear, vec3(lessThanEqual(linear, vec3(0.0031308))));
    }`;
  // Of a triangle in one colour it is that of its last corner.
  const CORNERS = `${LIT}
    #ifdef FLAT_SHADED
      flat
    #endif
    varying vec3 vFront;
    #ifdef DOUBLE_SIDED
      #ifdef FLAT_SHADED
        flat
      #endif
      varying vec3 vBack;
    #endif
    void main() {
      gl_Position = projectionMatrix * (modelViewMatrix * vec4(position, 1.0));
      vec3 n = normalize(normalMatrix * normal);
      vFront = lit(n);
      #ifdef DOUBLE_SIDED
        vBack = lit(-n);
      #endif
    }`;
  const BETWEEN = `
    uniform float opacity;
    #ifdef FLAT_SHADED
      flat
    #endif
    varying vec3 vFront;
    #ifdef DOUBLE_SIDED
      #ifdef FLAT_SHADED
        flat
      #endif
      varying vec3 vBack;
    #endif
    void main() {
      gl_FragColor = vec4(vFront, opacity);
      #ifdef DOUBLE_SIDED
        if (!gl_FrontFacing) gl_FragColor.rgb = vBack;
      #endif
    }`;
  const matte = new WeakMap();
  const matteOf = (material) => {
    if (!matte.has(material)) {
      const made = material.clone();
      made.onBeforeCompile = (shader) => {
        shader.vertexShader = CORNERS;
        shader.fragmentShader = BETWEEN;
      };
      made.customProgramCacheKey = () => "dynx-matte";
      matte.set(material, made);
    }
    const found = matte.get(material);
    found.color.copy(material.color);
    for (const name of ["opacity", "side", "flatShading", "transparent", "depthWrite", "depthTest"]) {
      if (found[name] === material[name]) continue;
      found[name] = material[name];
      found.needsUpdate = true;
    }
    return found;
  };
  let whole = [];
  const drawCoarsely = (renderer, scene, camera) => {
    if (!seen) scene.traverseVisible((each) => { seen ||= !!each.material?.isMeshStandardMaterial; });
    if (seen && !begun) setTimeout(() => { begun = true; }, CHECKS * CHECK_AFTER);
    if (!isMoving(camera)) return;
    let triangles = 0;
    scene.traverseVisible((mesh) => {
      const {geometry, material} = mesh;
      if (!mesh.isMesh || !isPlain(mesh)) return;
      whole.push([mesh, geometry, material]);
      const coarse = coarserFor(mesh, camera, renderer.domElement.height);
      if (coarse !== geometry) triangles += coarse.index.count / 3;
      mesh.geometry = material.flatShading ? facetsOf(coarse) : coarse;
      mesh.material = matteOf(material);
    });
    adjustCoarseness(triangles);
  };
  const drawWhole = () => {
    for (const [mesh, geometry, material] of whole) Object.assign(mesh, {geometry, material});
    whole = [];
  };
"""
)
"""Part of the script of a page that software draws. Each pixel is drawn once instead of four times, and the
picture is not kept for others to read, which a program gets in another way. Coarse shapes replace whole ones
only while a picture is drawn: the pointer meets whole ones."""
