"""Views as binary messages that have only what changed since the last one of the same page."""
from __future__ import annotations

import struct
from typing import Optional

import numpy as np

from .views import View

HEAD = struct.Struct("<IIdHHHHII")
"""Number of the view, step, time [s]; counts of bodies, contacts, coordinates, springs; build; flags (1: contacts are sent)."""


def encode(view: View, before: Optional[View]) -> bytes:
    """Little-endian: `HEAD`; float32: poses, contacts (6 each), coordinates, springs (10 each); uint16: indices of the
    poses' bodies, of the contacts' shapes (2 each), of the coordinates.

    :param before: that the page has; None: all is sent
    """
    if before is not None and (before.built != view.built or before.poses.shape != view.poses.shape):
        before = None
    if before is None:
        bodies, angles, contacts = np.arange(len(view.poses)), np.arange(len(view.q)), True
    else:
        bodies = np.flatnonzero((view.poses != before.poses).any(axis=1))
        angles = np.flatnonzero(view.q != before.q)
        contacts = (view.contacts.shape != before.contacts.shape or bool((view.contacts != before.contacts).any())
                    or bool((view.shapes != before.shapes).any()))
    count = len(view.contacts) if contacts else 0
    return b"".join((
        HEAD.pack(view.number & 0xFFFFFFFF, view.tick & 0xFFFFFFFF, view.time, len(bodies), count, len(angles),
                  len(view.springs), view.built, int(contacts)),
        view.poses[bodies].tobytes(), view.contacts[:count].tobytes(), view.q[angles].tobytes(), view.springs.tobytes(),
        bodies.astype("<u2").tobytes(), view.shapes[:count].astype("<u2").tobytes(), angles.astype("<u2").tobytes()))
