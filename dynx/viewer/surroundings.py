"""Script of the page that draws the sky and the tiled ground that pictures have.

The background of viser has one colour, and its ground is a grid. So the script draws the sky in the direction
of each pixel, and planes with tiles, haze and the light of `dynx.world.scenery`, which reach to the horizon.
"""

from __future__ import annotations

import json
from html import escape

from dynx.world.scenery import (
    DARK,
    FILL_DIRECTION,
    GAMMA,
    HAZE,
    HAZE_BELOW,
    HAZE_SHARE,
    KEY_DIRECTION,
    LIGHT,
    SUBTILE_CONTRAST,
    SUBTILES,
    TILE,
    TILE_CONTRAST,
    ZENITH,
    Scenery,
)

TILES = "dynx-tiles"
"""Identifier of the element that holds the edge of the tiles of planes [m]."""

GROUND = "/ground"
"""Path of the node of a ground that is added to what has none."""

SKY_LIGHT = "/sky"
"""Path of the node of the light of the sky."""


def tiles_element(tile: float) -> str:
    """Return the HTML element by which the page knows the edge of the tiles of planes [m]."""
    return f'<div id="{TILES}" style="display: none" data-tile="{escape(repr(tile), quote=True)}"></div>'


_VALUES = {
    "ZENITH": ZENITH,
    "HAZE": HAZE,
    "HAZE_BELOW": HAZE_BELOW,
    "HAZE_SHARE": HAZE_SHARE,
    "SUBTILES": float(SUBTILES),
    "TILE_CONTRAST": TILE_CONTRAST,
    "SUBTILE_CONTRAST": SUBTILE_CONTRAST,
}
_DEFINED = "".join(f"#define {name} {value}\n" for name, value in _VALUES.items())

_RINGS = [0.5 * 4.0**k for k in range(7)]
"""Distances of the lines along which a plane is divided, from below the eye, in heights of the eye. Without
lines near the eye the graphics processor would round places on the plane too much."""


def _values(scenery: Scenery) -> dict[str, object]:
    """Return what depends on whether the page is dark: colours, and amounts of light."""
    return {
        "zenith": scenery.zenith,
        "horizon": scenery.horizon,
        "nadir": scenery.ground,
        "key": scenery.key,
        "fill": scenery.fill,
        "above": scenery.sky_light,
        "below": scenery.ground_light,
    }


SURROUNDINGS = (
    f"const [TILES, GROUND, SKY_LIGHT] = {json.dumps([TILES, GROUND, SKY_LIGHT])}, TILE = {TILE};"
    f"const SCENERY = {json.dumps(_values(LIGHT))}, DARK_SCENERY = {json.dumps(_values(DARK))};"
    f"const DEFINED = {json.dumps(_DEFINED)}, RINGS = {json.dumps(_RINGS)}, GAMMA = {GAMMA};"
    f"const [TO_KEY, TO_FILL] = {json.dumps([KEY_DIRECTION.tolist(), FILL_DIRECTION.tolist()])};"
    + """
  const SKY = [`
    varying vec3 ray;
    void main() {
      vec2 place = 2.0 * position.xy;
      vec2 slope = (place + projectionMatrix[2].xy) / vec2(projectionMatrix[0][0], projectionMatrix[1][1]);
      ray = transpose(mat3(modelViewMatrix)) * vec3(slope, -1.0);
      // As far away as can be.
      #ifdef USE_REVERSED_DEPTH_BUFFER
        gl_Position = vec4(place, 0.0, 1.0);
      #else
        gl_Position = vec4(place, 1.0, 1.0);
      #endif
    }`, `
    ${DEFINED}
    uniform vec3 zenith, horizon, nadir;
    varying vec3 ray;
    void main() {
      float height = normalize(ray).z;
      vec3 above = mix(horizon, zenith, min(height / ZENITH, 1.0));
      vec3 below = mix(horizon, nadir, HAZE_SHARE * min(-height / HAZE_BELOW, 1.0));
      gl_FragColor = vec4(height >= 0.0 ? above : below, 1.0);
    }`];
  // A plane in its own axes. Places count from below the eye, where the tiles have a phase.
  const PLANE = [`
    uniform vec2 foot;
    uniform float reach;
    varying vec2 place;
    void main() {
      #ifdef SHADOW
        place = position.xy - foot;
      #else
        place = reach * position.xy;
      #endif
      gl_Position = projectionMatrix * (modelViewMatrix * vec4(foot + place, 0.0, 1.0));
    }`, `
    ${DEFINED}
    uniform vec3 horizon, colour;
    uniform vec2 phase;
    uniform float tile, reach, pixel, light, opacity;
    varying vec2 place;
    float waves(float edge, float extent) {
      vec2 at = (phase + place) / edge, within = fract(at);
      vec2 waves = clamp(2.0 * min(within, 1.0 - within) * edge / extent, 0.0, 1.0);
      waves *= 1.0 - 2.0 * step(0.5, fract(0.5 * at));
      return clamp((edge / extent - 2.0) / 6.0, 0.0, 1.0) * waves.x * waves.y;
    }
    void main() {
      float away = length(vec3(place, reach)), slope = reach / away, extent = pixel * away / slope;
      float tiles = TILE_CONTRAST * waves(tile, extent) + SUBTILE_CONTRAST * waves(tile / SUBTILES, extent);
      vec3 lit = light * min((1.0 + tiles) * colour, 1.0);
      gl_FragColor = vec4(mix(horizon, lit, min(slope / HAZE, 1.0)), opacity);
    }`];
  // The page does not tell its classes: its objects have them.
  const makeSurroundings = (scene) => {
    const behind = window.__viserMutable.backgroundMaterial, Material = behind.constructor;
    let picture;
    scene.traverse((each) => { if (each.material === behind) picture = each; });
    const Mesh = picture.constructor, Geometry = Object.getPrototypeOf(picture.geometry).constructor;
    const Attribute = Object.getPrototypeOf(picture.geometry.attributes.position).constructor;
    const drawn = (geometry, [vertexShader, fragmentShader], names, more) => {
      const uniforms = Object.fromEntries(names.map((name) => [name, {value: null}]));
      const mesh = new Mesh(geometry, new Material({vertexShader, fragmentShader, uniforms, ...more}));
      mesh.frustumCulled = mesh.matrixAutoUpdate = false;
      mesh.raycast = () => {};
      return mesh;
    };
    const lines = [...RINGS.map((each) => -each).reverse(), ...RINGS], count = lines.length;
    const points = lines.flatMap((y) => lines.flatMap((x) => [x, y, 0])), faces = [];
    for (let k = 0; k + count < count * count; k++)
      if (k % count < count - 1) faces.push(k, k + 1, k + count + 1, k, k + count + 1, k + count);
    const spread = new Geometry();
    spread.setAttribute("position", new Attribute(new Float32Array(points), 3));
    spread.setIndex(faces);
    const inputs = ["horizon", "colour", "light", "opacity", "foot", "phase", "tile", "reach", "pixel"];
    const plane = (geometry, more) => drawn(geometry, PLANE, inputs, {side: 2, ...more});
    const sky = drawn(picture.geometry, SKY, ["zenith", "horizon", "nadir"], {depthWrite: false});
    const shadow = plane(new Geometry(), {defines: {SHADOW: 1}, depthTest: false, depthWrite: false});
    // The shadow is laid over the ground before there is anything else. The sky fills what is left.
    shadow.renderOrder = -2;
    sky.renderOrder = 1;
    shadow.visible = false;
    return {behind, sky, shadow, addPlane: () => plane(spread), Attribute, planes: []};
  };
  const setValues = ({material}, values) => {
    for (const name in material.uniforms) material.uniforms[name].value = values[name];
  };
  const isVisible = (node) => {
    while (node?.visible) node = node.parent;
    return !node;
  };
  const isPlane = (path) => path === GROUND || /\\/plane\\d+$/.test(path);
  const valuesOf = (matrix, world, camera, seen, own) => {
    const eye = camera.position.clone().setFromMatrixPosition(camera.matrixWorld);
    eye.applyMatrix4(world.matrixWorld.clone().multiply(matrix).invert());
    const e = matrix.elements, side = Math.sign(eye.z) || 1, {tile} = seen;
    const opacity = own?.transparent ? own.opacity : 1;
    const colour = own ? own.color.toArray().map((each) => each ** (1 / GAMMA)) : seen.nadir;
    const phase = [eye.x, eye.y].map((each) => each - 2 * tile * Math.floor(each / (2 * tile)));
    const normal = [8, 9, 10].map((k) => side * e[k]);
    const facing = (towards) => Math.max(towards.reduce((sum, each, k) => sum + normal[k] * each, 0), 0);
    const around = seen.below + (seen.above - seen.below) * (0.5 + 0.5 * normal[2]);
    const shaded = around + seen.fill * facing(TO_FILL), lit = shaded + seen.key * facing(TO_KEY);
    return {...seen, opacity, colour, phase, light: lit ** (1 / GAMMA), shade: shaded ** (1 / GAMMA),
      reach: Math.max(Math.abs(eye.z), 1e-6), foot: [eye.x, eye.y]};
  };
  // The ground is the first opaque plane: its pose in the world, and what its program is given.
  let surroundings, ground = null;
  const drawSurroundings = (renderer, scene, camera) => {
    const nodes = window.__viserMutable.nodeRefFromName, world = nodes[""];
    if (surroundings === undefined) surroundings = makeSurroundings(scene);
    if (!surroundings || !world) return;
    const {behind, sky, planes, addPlane} = surroundings;
    const dark = document.documentElement.dataset.mantineColorScheme === "dark";
    const {height} = renderer.getRenderTarget() ?? renderer.domElement;
    const seen = {...(dark ? DARK_SCENERY : SCENERY),
      pixel: 2 / (camera.projectionMatrix.elements[5] * height),
      tile: Number(document.getElementById(TILES)?.dataset.tile ?? TILE)};
    if (sky.parent !== world) world.add(sky);
    // Without the light of the sky, or before a program's background, there is none.
    sky.visible = !!nodes[SKY_LIGHT]?.visible && !behind.uniforms.enabled.value;
    setValues(sky, seen);
    const paths = Object.keys(nodes).filter((path) => nodes[path] && isPlane(path));
    while (planes.length < paths.length) planes.push(addPlane());
    planes.forEach((drawn) => { drawn.visible = false; });
    paths.forEach((path, k) => {
      const drawn = planes[k];
      let quad;
      nodes[path].traverse((each) => { if (each.isMesh) quad ??= each; });
      // Pointers meet the square that stands for the plane.
      if (quad) quad.material.visible = false;
      if (!isVisible(quad ?? nodes[path])) return;
      if (drawn.parent !== world) world.add(drawn);
      drawn.visible = true;
      drawn.matrix.copy(world.matrixWorld).invert().multiply((quad ?? nodes[path]).matrixWorld);
      drawn.updateMatrixWorld(true);
      const values = valuesOf(drawn.matrix, world, camera, seen, quad?.material);
      setValues(drawn, values);
      drawn.material.transparent = values.opacity < 1;
      drawn.material.depthWrite = values.opacity === 1;
      drawn.renderOrder = -1;
      if (ground || values.opacity < 1) return;
      ground = {matrix: drawn.matrix, values};
      drawn.renderOrder = -3;
    });
  };
  const surround = (...given) => {
    ground = null;
    try { drawSurroundings(...given); } catch (error) {
      // Another version of viser has its own background then.
      surroundings = null;
      console.error("dynx: this version of viser cannot draw sky and ground", error);
    }
  };
"""
)
"""Part of the script that draws the surroundings, before each picture."""
