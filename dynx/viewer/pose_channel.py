"""`PoseChannel`: poses of many nodes of a page in one message.

viser sends two messages for each node that moves, which are a hundred for each pose of a humanoid. One array
goes to the page instead, whose script makes of it what viser would have sent (`PLACING`).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats
from dynx.viewer.library import put_pose, send_values

_NODES, _POSES = "dynx_nodes", "dynx_poses"
"""Names of the values of a node: the nodes that are placed by its channel, and their poses."""

PLACING = (
    f"const [NODES, POSES] = {json.dumps([_NODES, _POSES])};"
    + """
  const placed = {}, colours = {};
  const unpacked = (message) => {
    noteMessage(message);
    const given = message.type === "SceneNodeUpdateMessage" ? message.updates : {};
    if (given[NODES]) placed[message.name] = given[NODES];
    const numbers = given[POSES], owner = message.owner, found = [];
    if (!numbers) return given[NODES] ? [] : [message];
    noteMotion();
    let k = 0;
    for (const [name, copies, colour] of placed[message.name]) {
      if (colour) colours[name] = colour;
      if (copies === null) {
        const [x, y, z, a, b, c, d] = numbers.subarray(k, k += 7);
        found.push({type: "SetPositionMessage", name, owner, position: [x, y, z]});
        found.push({type: "SetOrientationMessage", name, owner, wxyz: [a, b, c, d]});
      } else {
        const batched_positions = numbers.subarray(k, k += 3 * copies);
        const batched_wxyzs = numbers.subarray(k, k += 4 * copies);
        const updates = {batched_positions, batched_wxyzs};
        found.push({type: "SceneNodeUpdateMessage", name, owner, updates});
      }
    }
    return found;
  };
  const unpack = (queue) => {
    const push = Array.prototype.push;
    queue.push = (...messages) => {
      return push.apply(queue, messages.filter((each) => !isHeld(each)).flatMap(unpacked));
    };
    if (queue.length) queue.push(...queue.splice(0));
  };
  // Messages may come as soon as the page has its queue.
  let shown;
  Object.defineProperty(window, "__viserMutable", {
    configurable: true,
    get: () => shown,
    set: (page) => {
      if (page && page !== shown) {
        awaitShapes(page);
        unpack(page.messageQueue);
        queueMicrotask(prepare);
      }
      shown = page;
    },
  });
"""
)
"""Part of the script of the page that unpacks the messages of channels where they are queued."""


class CopiedNode(NamedTuple):
    """A node that shows one shape many times."""

    node: Any
    rows: NDArray[np.intp]
    """Numbers (n,) of the poses at which it is shown."""
    colour: tuple[float, float, float] | None
    """Light that it reflects, from 0 to 1; None for the colours of its file. viser knows colours of copies in
    256 steps of light alone, in which dark ones differ from those of other nodes."""


class PoseChannel:
    """Sends the poses of nodes, and of the copies that nodes show, as one array at a time.

    Poses are numbered; each places one node, any number of copies, or both.
    """

    def __init__(self, root: Any, nodes: Mapping[int, Any], copied: Iterable[CopiedNode] = ()) -> None:
        """`root` is the node above all others, with which the channel ends; it has one channel. `nodes` are
        those that are placed by each pose."""
        self._root, self._nodes, self._copied = root, dict(nodes), list(copied)
        self._declare()

    def add(self, number: int, node: Any) -> None:
        """Let a pose place a node, from the next `send` on."""
        self._nodes[number] = node
        self._declare()

    def add_copies(self, copied: Iterable[CopiedNode]) -> None:
        """Let poses place copies, from the next `send` on."""
        self._copied += copied
        self._declare()

    def _declare(self) -> None:
        nodes: list[list[Any]] = [[node.name, None, None] for node in self._nodes.values()]
        nodes += [[each.node.name, len(each.rows), each.colour] for each in self._copied]
        send_values(self._root, {_NODES: nodes})

    def send(self, positions: Floats, wxyzs: Floats, moved: Iterable[int]) -> None:
        """Place everything at the positions (n, 3) [m] and the unit quaternions (n, 4) of all poses; the
        numbers of those that `moved` since the last time are given."""
        for number in moved:
            if number in self._nodes:
                put_pose(self._nodes[number], positions[number], wxyzs[number])
        numbers = list(self._nodes)
        packed = [np.concatenate([positions[numbers], wxyzs[numbers]], axis=1).reshape(-1)]
        for each in self._copied:
            packed += [positions[each.rows].reshape(-1), wxyzs[each.rows].reshape(-1)]
        send_values(self._root, {_POSES: np.concatenate(packed).astype(np.float32)})
