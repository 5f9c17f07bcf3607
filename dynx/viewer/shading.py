"""Script of the page that casts shadows on the ground.

viser can draw shadows from a map of depths, which a page drawn by software has no time for. So the script
projects the shapes along the key light onto the ground, as triangles of one mesh.
"""

from __future__ import annotations

import json

from dynx.world.scenery import KEY_DIRECTION

CELLS = 10
"""Number of cells along the diagonal of a mesh, in each of which one vertex of its shadow lies."""

SHADOWS = (
    f"const TOWARDS = {json.dumps(KEY_DIRECTION.tolist())}, CELLS = {CELLS};"
    + """
  // Ghosts, which lie below the node /second, have no shadow, as in pictures.
  const CASTS = /^\\/(motion|robot|world|first)\\/(.*\\/)?(visual|shape)\\d+$/;
  const outlines = new WeakMap();
  const outlined = (geometry, cells) => {
    const given = geometry.attributes.position, index = geometry.index, count = given.count;
    geometry.computeBoundingBox();
    const {min, max} = geometry.boundingBox, cell = min.distanceTo(max) / cells || 1;
    const number = new Map(), of = new Uint32Array(count), sums = [];
    for (let k = 0; k < count; k++) {
      const x = given.getX(k), y = given.getY(k), z = given.getZ(k);
      const key = Math.floor((x - min.x) / cell) + 16 * Math.floor((y - min.y) / cell)
        + 256 * Math.floor((z - min.z) / cell);
      if (!number.has(key)) { number.set(key, number.size); sums.push(0, 0, 0, 0); }
      const place = 4 * (of[k] = number.get(key));
      sums[place] += x; sums[place + 1] += y; sums[place + 2] += z; sums[place + 3] += 1;
    }
    const points = new Float32Array(3 * number.size), faces = [], known = new Set();
    for (let k = 0; k < number.size; k++)
      for (let axis = 0; axis < 3; axis++) points[3 * k + axis] = sums[4 * k + axis] / sums[4 * k + 3];
    const corners = index ? index.count : count;
    for (let k = 0; k + 2 < corners; k += 3) {
      const [a, b, c] = [0, 1, 2].map((j) => of[index ? index.getX(k + j) : k + j]).sort((m, n) => m - n);
      const key = (a * number.size + b) * number.size + c;
      if (a === b || b === c || known.has(key)) continue;
      known.add(key);
      faces.push(a, b, c);
    }
    return {points, faces};
  };
  let casting = null, castFrom = [], castAt = null;
  const castShadows = (renderer, camera) => {
    const nodes = window.__viserMutable.nodeRefFromName, world = nodes[""], shadow = surroundings?.shadow;
    if (shadow) shadow.visible = false;
    // A plane that light meets from behind has no shadows.
    const towardsKey = (axis) =>
      ground.matrix.elements.slice(4 * axis, 4 * axis + 3).reduce((sum, e, k) => sum + e * TOWARDS[k], 0);
    const facing = ground && towardsKey(2);
    if (!world || !(facing > 1e-3)) return;
    const meshes = [];
    for (const path in nodes) {
      if (!nodes[path] || !CASTS.test(path)) continue;
      if (!isVisible(nodes[path])) continue;
      nodes[path].traverseVisible((each) => {
        const solid = each.isMesh && !each.isInstancedMesh && !Array.isArray(each.material);
        if (solid && each.material.isMeshStandardMaterial && each.material.opacity > 0.5) meshes.push(each);
      });
    }
    if (!meshes.length) return;
    if (shadow.parent !== world) world.add(shadow);
    const of = meshes.map((mesh) => {
      const {geometry} = mesh, level = levelWhileMoving(mesh, renderer, camera);
      // The outline of a shadow needs half as many cells as a shape with its light.
      const cells = Math.min(2 ** Math.max(Math.round(level) - 1, 2), CELLS);
      if (!outlines.has(geometry)) outlines.set(geometry, new Map());
      const found = outlines.get(geometry);
      if (!found.has(cells)) found.set(cells, outlined(geometry, cells));
      return found.get(cells);
    });
    const present = meshes.map((each, k) => [each.geometry.uuid, of[k].points.length]).join();
    if (present !== casting) {
      casting = present;
      let first = 0;
      const faces = [];
      for (const {points, faces: own} of of) {
        for (const k of own) faces.push(first + k);
        first += points.length / 3;
      }
      const {Attribute} = surroundings;
      shadow.geometry.dispose();
      shadow.geometry = new shadow.geometry.constructor();
      shadow.geometry.setAttribute("position", new Attribute(new Float32Array(3 * first), 3));
      shadow.geometry.setIndex(faces);
      castFrom = [];
    }
    const position = shadow.geometry.attributes.position, to = position.array;
    // In the axes of the ground.
    const inverse = world.matrixWorld.clone().multiply(ground.matrix).invert(), pose = inverse.clone();
    const onGround = ground.matrix.elements.join();
    if (onGround !== castAt) castFrom = [];
    castAt = onGround;
    const [across, along] = [0, 1].map((k) => towardsKey(k) / facing);
    let place = 0;
    meshes.forEach((mesh, number) => {
      const e = pose.multiplyMatrices(inverse, mesh.matrixWorld).elements, {points} = of[number];
      // What stands still keeps its shadow.
      if (castFrom[number]?.every((each, k) => each === e[k])) {
        place += points.length;
        return;
      }
      castFrom[number] = [...e];
      position.needsUpdate = true;
      for (let k = 0; k < points.length; k += 3) {
        const x = points[k], y = points[k + 1], z = points[k + 2];
        const above = Math.max(e[2] * x + e[6] * y + e[10] * z + e[14], 0);
        to[place++] = e[0] * x + e[4] * y + e[8] * z + e[12] - across * above;
        to[place++] = e[1] * x + e[5] * y + e[9] * z + e[13] - along * above;
        to[place++] = 0;
      }
    });
    shadow.matrix.copy(ground.matrix);
    shadow.updateMatrixWorld(true);
    setValues(shadow, {...ground.values, light: ground.values.shade});
    shadow.visible = true;
  };
  // Axes of frames are seen through the parts in which they lie.
  const axes = new WeakSet();
  const layAxesOver = () => {
    const nodes = window.__viserMutable.nodeRefFromName;
    for (const path in nodes)
      if (path.endsWith("/axes")) nodes[path]?.traverse((each) => {
        if (!each.isMesh || axes.has(each)) return;
        axes.add(each);
        each.renderOrder = 1000;
        for (const material of [each.material].flat()) {
          material.depthTest = false;
          material.transparent = true;
          material.needsUpdate = true;
        }
      });
  };
"""
)
"""Part of the script that casts the shadows of visual shapes on the ground, before each picture. Each mesh
has the shadow of a coarse one, all of whose vertices within a cell are one."""
