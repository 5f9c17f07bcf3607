"""Script of the page that leaves out what would delay its first picture."""

from __future__ import annotations

import json

LATER = 3.0
"""Time after which programs are prepared that the first picture does not need [s]."""

LONGEST = 1.0
"""Longest time for which controls wait for shapes [s]."""

FIRST_PICTURE = (
    f"const LATER = {json.dumps(1e3 * LATER)}, LONGEST = {json.dumps(1e3 * LONGEST)};"
    + """
  const getContext = HTMLCanvasElement.prototype.getContext;
  // The page has a state above its picture, which is set before the picture has its first lights.
  const withoutSurroundings = (canvas) => {
    const key = Object.keys(canvas).find((each) => each.startsWith("__reactFiber$"));
    for (let above = canvas[key]; above; above = above.return) {
      const state = above.memoizedProps?.value?.useEnvironment;
      if (!state?.set) continue;
      const environmentMap = {type: "EnvironmentMapMessage", hdri_data: null, background: false};
      state.set({environmentMap, enableDefaultLights: false});
      return;
    }
  };
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    if (kind === "webgl2" && this.isConnected) withoutSurroundings(this);
    return getContext.call(this, kind, options);
  };
  // Programs of what is seen later, which viser prepares, come after those of the first picture.
  const prepareLater = (renderer) => {
    const {compileAsync} = renderer;
    renderer.compileAsync = (...given) => new Promise((done) => {
      setTimeout(() => done(compileAsync.apply(renderer, given)), LATER);
    });
  };
  const SHOWN = /\\/(visual|shape|stick)\\d+$/;
  let controls = null, limit = null;
  const awaitShapes = (page) => {
    const renderer = page.scene?.__r3f?.root?.getState?.().gl;
    if (!renderer) return;
    prepareLater(renderer);
    controls = [];
  };
  const addControls = () => {
    const page = window.__viserMutable, held = controls;
    if (!held) return;
    controls = null;
    page.messageQueue.push(...held);
    page.requestRender();
  };
  const isHeld = (message) => {
    if (controls && message.type === "ResetGuiMessage") controls.length = 0;
    // The picture keeps its size where the panel has its place before.
    if (!controls || !/^Gui(?!SetPanel|Panel)/.test(message.type)) return false;
    limit ??= setTimeout(addControls, LONGEST);
    controls.push(message);
    return true;
  };
  const noteShapes = () => {
    if (!controls) return;
    const nodes = window.__viserMutable.nodeRefFromName;
    // After the picture that is being drawn.
    for (const path in nodes) if (nodes[path] && SHOWN.test(path)) return setTimeout(addControls);
  };
"""
)
"""Part of the script of the page. viser's own surroundings, which dynx never shows, take the time of several
pictures in software, and so do the controls, which come after the first picture of shapes."""
