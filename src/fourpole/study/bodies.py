"""The inertia of specimens as found: the rows of specimens.csv."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.joint import Joint
from fourpole.core.joint.belts import Found, found_specimens
from fourpole.core.specimen import Form
from fourpole.study.identify import RigGroup
from fourpole.study.points import Points


def specimen_rows(points: Points, group: RigGroup) -> Iterator[dict[str, Any]]:
    """The rows of specimens.csv of one rig: each specimen at each condition without its frequency."""
    joint = group.joint
    assert joint is not None
    for found in found_specimens(joint.problem, joint.solution):
        place = group.rows[joint.order[found.test]]
        if points.strange[place]:  # it is alone in its condition
            continue
        test = points.tests[place]
        row = {
            q.TYRE.head: test.tyre,
            q.RIG.head: group.rig_name,
            q.PRESSURE.head: test.value("pressure"),
            q.PRELOAD.head: test.value("preload"),
            **({q.TEMPERATURE.head: warm} if (warm := test.value("temperature")) is not None else {}),
            q.FORM.head: found.specimen.form.value,
        }
        yield row if found.specimen.form is Form.MASSLESS else row | _inertia(joint, found)


def _inertia(joint: Joint, found: Found) -> dict[str, Any]:
    """The cells of a specimen with a mass."""
    specimen, belt = found.specimen, found.specimen.form is Form.BELT
    free, held = specimen.frequencies(found.stiffness)[0].tolist()
    free_std, held_std, share_std = found.stds.tolist()
    return {
        q.BELT_MASS.head: specimen.mass,
        q.BELT_MASS.u_head: found.mass_std,
        q.BELT_FREE.head: free,
        q.BELT_FREE.u_head: free_std,
        q.BELT_HELD.head: held,
        q.BELT_HELD.u_head: held_std,
        q.BELT_SHARE.head: float(np.abs(specimen.share_at(np.asarray(found.stiffness)))) if belt else None,
        q.BELT_SHARE.u_head: share_std if belt else None,
        q.BELT_EXPONENT.head: specimen.exponent if belt else None,
        q.BELT_SPREAD.head: None if belt else specimen.spread,
        q.BELT_SPREAD.u_head: None if belt else found.spread_std,
        q.BELT_EVIDENCE.head: joint.misfit.belts,
    }
