"""Script of the page that takes light of the sky from where surfaces are near each other.

The page of viser has no passes after its picture. So the script draws normals and depths of opaque surfaces
before each picture, and finds from them how much of the sky each pixel sees, as pictures do
(`dynx.world.camera`). The materials of the picture then have that share of the light from around. A page
that software draws has no time for it.
"""

from __future__ import annotations

import json

from dynx.world.scenery import (
    FILL_DIRECTION,
    GAMMA,
    KEY_DIRECTION,
    LEAST_OPENNESS,
    LIGHT,
    OCCLUSION_REACH,
    OCCLUSION_SHARE,
    OCCLUSION_SLOPE,
    OCCLUSION_STEPS,
    OCCLUSION_TURNS,
)

NO_OCCLUSION = "const occlude = () => {};"
"""Part of the script of a page that software draws."""

PATCHED = "#include <aomap_fragment>"
"""Line of the program of a material of three.js after which the light from around is known."""

_VALUES = {
    "TURNS": OCCLUSION_TURNS,
    "STEPS": OCCLUSION_STEPS,
    "SLOPE": OCCLUSION_SLOPE,
    "SHARE": OCCLUSION_SHARE,
    "LEAST": LEAST_OPENNESS,
    "AROUND": LIGHT.sky_light + LIGHT.fill * float(FILL_DIRECTION[2]),
    "KEY": LIGHT.key * float(KEY_DIRECTION[2]),
    "EXPONENT": 1.0 / GAMMA,
}
"""Constants of the programs of the graphics processor; `AROUND` and `KEY` are light on the ground."""
_CONSTANTS = "".join(f"#define {name} {value}\n" for name, value in _VALUES.items())

OCCLUSION = (
    f"const PATCHED = {json.dumps(PATCHED)}, REACH = {OCCLUSION_REACH};"
    f"const CONSTANTS = {json.dumps(_CONSTANTS)};"
    + """
  // Normals towards the eye, and depths; a depth of zero for nothing.
  const SURFACES = [`
    #include <common>
    #include <batching_pars_vertex>
    varying vec3 place;
    void main() {
      #include <batching_vertex>
      #include <begin_vertex>
      #include <project_vertex>
      place = mvPosition.xyz;
    }`, `
    varying vec3 place;
    void main() {
      vec3 normal = cross(dFdx(place), dFdy(place));
      normal /= max(length(normal), 1e-30);
      gl_FragColor = vec4(dot(normal, place) > 0.0 ? -normal : normal, -place.z);
    }`];
  const OPENNESS = [`
    void main() { gl_Position = vec4(2.0 * position.xy, 0.5, 1.0); }`, `
    ${CONSTANTS}
    uniform sampler2D surfaces;
    uniform vec2 slopes;
    uniform float reach;
    void main() {
      ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(surfaces, 0);
      vec4 own = texelFetch(surfaces, pixel, 0);
      float radius = reach * 0.5 * float(size.y) / (slopes.y * own.w);
      gl_FragColor = vec4(1.0, own.w, 0.0, 0.0);
      if (own.w <= 0.0 || radius <= 1.5) return;
      radius = min(radius, 0.25 * float(size.y));
      vec2 scale = 2.0 * slopes / vec2(size);
      vec3 point = own.w * vec3(scale * (vec2(pixel) + 0.5) - slopes, -1.0);
      float turn = float(pixel.x % TURNS + TURNS * (pixel.y % TURNS)) / float(TURNS * TURNS), hidden = 0.0;
      for (int k = 0; k < STEPS; k++) {
        float angle = 6.2831853 * (turn + 0.381966 * float(k));
        float away = radius * ((float(k) + turn + 0.1) / float(STEPS));
        ivec2 other = pixel + ivec2(round(away * vec2(cos(angle), sin(angle))));
        other = clamp(other, ivec2(0), size - 1);
        float far = texelFetch(surfaces, other, 0).w;
        if (far <= 0.0) continue;
        vec3 between = far * vec3(scale * (vec2(other) + 0.5) - slopes, -1.0) - point;
        float square = dot(between, between), sine = dot(between, own.xyz) * inversesqrt(max(square, 1e-18));
        hidden += max(sine - SLOPE, 0.0) * max(1.0 - square / (reach * reach), 0.0);
      }
      gl_FragColor.x = max(1.0 - SHARE * hidden / float(STEPS), LEAST);
    }`];
  // The mean of the square in which pixels look at different places, of what is near in depth.
  const OPEN = `
    ${CONSTANTS}
    uniform sampler2D openness;
    uniform float reach;
    float openAt(float depth) {
      ivec2 pixel = ivec2(gl_FragCoord.xy), last = textureSize(openness, 0) - 1;
      vec2 sum = vec2(0.0);
      for (int k = 0; k < TURNS * TURNS; k++) {
        ivec2 other = pixel + ivec2(k % TURNS, k / TURNS) - TURNS / 2;
        vec2 found = texelFetch(openness, clamp(other, ivec2(0), last), 0).xy;
        if (abs(found.y - depth) < 0.5 * reach) sum += vec2(found.x, 1.0);
      }
      return sum.y > 0.0 ? sum.x / sum.y : 1.0;
    }
    void main() {`;
  // What a ground gets less light by is laid over it.
  const VEIL = [`
    varying float depth;
    void main() {
      vec4 seen = modelViewMatrix * vec4(position, 1.0);
      depth = -seen.z;
      gl_Position = projectionMatrix * seen;
    }`, `
    varying float depth;
    ${OPEN}
      float light = (AROUND * openAt(depth) + KEY) / (AROUND + KEY);
      gl_FragColor = vec4(vec3(0.0), 1.0 - pow(light, EXPONENT));
    }`];
  const shared = {openness: {value: null}, reach: {value: 0}};
  let tools;
  // Another version of viser may draw in another way; its picture is whole without this.
  const refuse = (reason) => {
    if (tools === null) return;
    if (tools) tools.veil.visible = false;
    tools = null;
    shared.reach.value = 0;
    console.error("dynx: this version of viser cannot draw ambient occlusion", reason);
  };
  const patched = new WeakSet();
  const patch = (material) => {
    if (patched.has(material)) return;
    patched.add(material);
    // Shaders of others stay as they are.
    if (material.onBeforeCompile !== material.constructor.prototype.onBeforeCompile) return;
    material.onBeforeCompile = (shader) => {
      const text = shader.fragmentShader;
      if (!text.includes(PATCHED) || !text.includes("vViewPosition")) return refuse("other materials");
      Object.assign(shader.uniforms, shared);
      shader.fragmentShader = text.replace("void main() {", OPEN)
        .replace(PATCHED, PATCHED + "\\nreflectedLight.indirectDiffuse *= openAt(vViewPosition.z);");
    };
    material.customProgramCacheKey = () => "dynx-occluded";
    material.needsUpdate = true;
  };
  const toolsOf = (renderer, scene) => {
    const gl = renderer.getContext(), named = gl.getExtension("WEBGL_debug_renderer_info");
    const name = gl.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
    if (/swiftshader|llvmpipe|softpipe|software|basic render/i.test(name)) return null;
    if (!gl.getExtension("EXT_color_buffer_float")) return null;
    // The page does not tell its classes: its objects have them.
    const behind = window.__viserMutable.backgroundMaterial, Material = behind.constructor;
    const Scene = scene.constructor;
    let lamp, plane;
    scene.traverse((each) => {
      if (each.isDirectionalLight) lamp = each;
      if (each.material === behind) plane = each;
    });
    if (!lamp) return undefined;
    // A map of shadows is a target of its class.
    const {enabled} = renderer.shadowMap, light = lamp.clone();
    light.shadow.mapSize.set(1, 1);
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.render([light], new Scene(), scene.__r3f.root.getState().camera);
    renderer.shadowMap.enabled = enabled;
    const Target = light.shadow.map.constructor;
    light.shadow.map.dispose();
    // Numbers of three.js.
    const [FLOAT, HALF_FLOAT, NEAREST] = [1015, 1016, 1003];
    const target = (type) => new Target(1, 1, {type, minFilter: NEAREST, magFilter: NEAREST});
    const drawn = ([vertexShader, fragmentShader], more) =>
      new Material({vertexShader, fragmentShader, blending: 0, side: 2, ...more});
    const surfaces = target(FLOAT), openness = target(HALF_FLOAT), stage = new Scene(), table = new Scene();
    const quad = new plane.constructor(plane.geometry, drawn(OPENNESS, {depthTest: false, depthWrite: false,
      uniforms: {surfaces: {value: surfaces.texture}, slopes: {value: [1, 1]}, reach: shared.reach}}));
    const veil = new plane.constructor(plane.geometry, drawn(VEIL, {transparent: true, blending: 1,
      depthWrite: false, uniforms: shared, polygonOffset: true, polygonOffsetFactor: -1,
      polygonOffsetUnits: -4}));
    veil.raycast = () => {};
    veil.matrixAutoUpdate = false;
    quad.frustumCulled = false;
    table.add(quad);
    stage.matrixWorldAutoUpdate = false;
    stage.overrideMaterial = drawn(SURFACES);
    shared.openness.value = openness.texture;
    return {surfaces, openness, stage, table, quad, veil};
  };
  const boxes = new WeakMap();
  const boxOf = (mesh) => {
    const owner = mesh.computeBoundingBox ? mesh : mesh.geometry;
    if (!boxes.has(owner)) {
      // viser changes vertices, by which pointers would then miss the box of before.
      const before = owner.boundingBox;
      owner.boundingBox = null;
      owner.computeBoundingBox();
      boxes.set(owner, owner.boundingBox);
      owner.boundingBox = before;
    }
    return boxes.get(owner);
  };
  const isFlat = ({min, max}) => Math.min(max.x - min.x, max.y - min.y, max.z - min.z) === 0;
  const layVeil = (box, reach) => {
    const world = window.__viserMutable.nodeRefFromName[""], {veil} = tools;
    veil.visible = !!world && !!ground;
    if (!veil.visible) return;
    if (veil.parent !== world) world.add(veil);
    const own = box.clone().applyMatrix4(world.matrixWorld.clone().multiply(ground.matrix).invert());
    own.getCenter(veil.position).z = 0;
    own.getSize(veil.scale).addScalar(4 * reach).z = 1;
    veil.updateMatrix();
    veil.matrix.premultiply(ground.matrix);
    veil.updateMatrixWorld(true);
  };
  const findOpenness = (renderer, camera, meshes) => {
    const {surfaces, openness, stage, table, quad} = tools, before = renderer.getRenderTarget();
    const {width, height} = before ?? renderer.domElement, {elements} = camera.projectionMatrix;
    for (const each of [surfaces, openness])
      if (each.width !== width || each.height !== height) each.setSize(width, height);
    quad.material.uniforms.slopes.value = [1 / elements[0], 1 / elements[5]];
    const clear = renderer.getClearAlpha();
    stage.children = meshes;
    try {
      renderer.setClearAlpha(0);
      renderer.setRenderTarget(surfaces);
      renderer.render(stage, camera);
      renderer.setRenderTarget(openness);
      renderer.render(table, camera);
    } finally {
      renderer.setRenderTarget(before);
      renderer.setClearAlpha(clear);
    }
  };
  const darken = (renderer, scene, camera) => {
    shared.reach.value = 0;
    if (tools === undefined) tools = toolsOf(renderer, scene);
    if (!tools) return;
    tools.veil.visible = false;
    // Surfaces without gloss have their own colours.
    if ((window.__dynxRoughness ?? ROUGHNESS) === 1) return;
    const meshes = [];
    let all = null;
    scene.traverseVisible((each) => {
      const materials = each.isMesh && !each.isSkinnedMesh ? [each.material].flat() : [];
      const isSolid = (own) => own.isMeshStandardMaterial && !own.transparent && !own.wireframe;
      if (!materials.length || !materials.every(isSolid)) return;
      materials.forEach(patch);
      meshes.push(each);
      const box = boxOf(each);
      // A plane has no end.
      if (isFlat(box)) return;
      const placed = box.clone().applyMatrix4(each.matrixWorld);
      all = all ? all.union(placed) : placed;
    });
    if (!all) return;
    shared.reach.value = REACH * 0.5 * all.min.distanceTo(all.max);
    layVeil(all, shared.reach.value);
    findOpenness(renderer, camera, tools.veil.visible ? [...meshes, tools.veil] : meshes);
  };
  const occlude = (...given) => {
    try { darken(...given); } catch (error) { refuse(error); }
  };
"""
)
"""Part of the script of the page of a graphics processor."""
