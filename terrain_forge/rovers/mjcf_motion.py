"""What ties the joints of an MJCF to each other: gears, and what of it is not read."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrain_forge.model import Coupling
from terrain_forge.rovers import bounds
from terrain_forge.rovers.assembly import Unread

_LINEAR = 2
"""Numbers of an equality's polynomial that a gear has: an offset and a ratio."""
_POLYNOMIAL = 5
OF_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
"""Kinds of actuators that turn a joint."""
_ENDS = {
    mujoco.mjtTrn.mjTRN_SITE: "site",
    mujoco.mjtTrn.mjTRN_SLIDERCRANK: "site",
    mujoco.mjtTrn.mjTRN_BODY: "body",
    mujoco.mjtTrn.mjTRN_TENDON: "tendon",
}
"""What an actuator that turns no joint acts on."""


def called(model: Any, kind: str, index: int) -> str:
    """The name of a `body`, `joint`, `geom`, …; its number where it has none."""
    return bounds.check_name(getattr(model, kind)(index).name or f"{kind}_{index}", kind)


def _not_zero(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Which rows have a number that is not 0; some versions of MuJoCo have several in each."""
    return np.asarray(values.any(axis=tuple(range(1, values.ndim))))


class Ties:
    """The ties of a tree of bodies; those of another tree are none of the rover's."""

    def __init__(self, model: Any, root: int) -> None:
        self._model, self._root = model, root
        self.gears = list[Coupling]()
        """What is linear between two joints."""
        self.unread = [*self._of_joints(), *self._of_bodies(), *self._of_actuators()]
        """What else changes how the tree moves."""
        self.unread += [Unread("tendon", called(model, "tendon", n)) for n in self._acting()]
        for number in np.flatnonzero(model.eq_active0).tolist():
            gear = self._gear(number)
            if gear is not None:
                self.gears.append(gear)
            elif self._is_own_equality(number):
                kind = mujoco.mjtEq(int(model.eq_type[number])).name.removeprefix("mjEQ_").lower()
                own = bounds.check_name(self._model.equality(number).name, "equality")
                self.unread.append(Unread(f"equality {kind}", own or self._ends(number)))

    def _of_joints(self) -> list[Unread]:
        """Springs and the inertia of gear trains."""
        model, found = self._model, list[Unread]()
        stiff = _not_zero(model.jnt_stiffness)
        for joint in range(model.njnt):
            name, address = called(model, "joint", joint), int(model.jnt_dofadr[joint])
            if not self._is_own("joint", joint):
                continue
            if stiff[joint]:
                found.append(Unread("spring", name, joint=name))
            if model.dof_armature[address] and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
                found.append(Unread("armature", name, joint=name))
        return found

    def _of_bodies(self) -> list[Unread]:
        """Bodies that gravity pulls otherwise, and what bends."""
        model = self._model
        lifted = np.flatnonzero(model.body_gravcomp).tolist()
        found = [
            Unread("gravity compensation", called(model, "body", body))
            for body in lifted
            if self._is_own("body", body)
        ]
        bent = np.flatnonzero(model.body_rootid[model.flex_vertbodyid] == self._root)
        return [*found, *([Unread("flex", "soft parts")] if bent.size else [])]

    def _of_actuators(self) -> list[Unread]:
        """Actuators on anything but joints."""
        model, found = self._model, list[Unread]()
        for number in range(model.nu):
            end = _ENDS.get(mujoco.mjtTrn(int(model.actuator_trntype[number])))
            if end and self._is_own(end, int(model.actuator_trnid[number, 0])):
                found.append(Unread(f"actuator on a {end}", called(model, "actuator", number)))
        return found

    def _acting(self) -> list[int]:
        """Tendons that pull, damp or stop anything by themselves."""
        acts = np.zeros(self._model.ntendon, bool)
        for what in ("stiffness", "damping", "frictionloss", "armature", "limited"):
            acts |= _not_zero(getattr(self._model, f"tendon_{what}"))
        return [n for n in np.flatnonzero(acts).tolist() if self._is_own("tendon", n)]

    def _is_own(self, kind: str, index: int) -> bool:
        """Whether a body, joint, site, geom or tendon is of the tree."""
        model = self._model
        if kind == "tendon":
            return any(self._is_own(*wrap) for wrap in self._wraps(index))
        bodies = {
            "joint": model.jnt_bodyid, "site": model.site_bodyid, "geom": model.geom_bodyid,
        }  # fmt: skip
        body = int(bodies[kind][index]) if kind in bodies else index
        return bool(model.body_rootid[body] == self._root)

    def _wraps(self, tendon: int) -> list[tuple[str, int]]:
        """What a tendon runs along."""
        wrap, model = mujoco.mjtWrap, self._model
        kinds = {
            wrap.mjWRAP_JOINT: "joint", wrap.mjWRAP_SITE: "site",
            wrap.mjWRAP_SPHERE: "geom", wrap.mjWRAP_CYLINDER: "geom",
        }  # fmt: skip
        first = int(model.tendon_adr[tendon])
        wraps = range(first, first + int(model.tendon_num[tendon]))
        told = [(kinds.get(wrap(int(model.wrap_type[n]))), int(model.wrap_objid[n])) for n in wraps]
        return [(kind, number) for kind, number in told if kind is not None]

    def _gear(self, equality: int) -> Coupling | None:
        """What an equality of joints or fixed tendons says of two joints, if that is linear.

        It is about angles from the pose as written: Σ cᵢ qᵢ = offset.
        """
        model, polynomial = self._model, self._model.eq_data[equality, :_POLYNOMIAL]
        one, other = (self._sum(equality, end) for end in (0, 1))
        if one is None or other is None or polynomial[_LINEAR:].any():
            return None
        terms = dict(one)
        for joint, coefficient in other.items():
            terms[joint] = terms.get(joint, 0.0) - float(polynomial[1]) * coefficient
        if len(terms) != _LINEAR or not next(iter(terms.values())):
            return None
        (follower, own), (leader, theirs) = terms.items()
        return Coupling(
            link=called(model, "joint", follower),
            leader=called(model, "joint", leader),
            ratio=-theirs / own + 0.0,
            offset=float(polynomial[0]) / own,
        )

    def _sum(self, equality: int, end: int) -> dict[int, float] | None:
        """Joints and their coefficients at an end of an equality; None where it is no sum."""
        model, kind = self._model, mujoco.mjtEq(int(self._model.eq_type[equality]))
        index = int((model.eq_obj1id, model.eq_obj2id)[end][equality])
        if kind not in (mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtEq.mjEQ_TENDON):
            return None
        if index < 0:
            return {}
        if kind == mujoco.mjtEq.mjEQ_JOINT:
            return {index: 1.0}
        if any(what != "joint" for what, _ in self._wraps(index)):
            return None
        first = int(model.tendon_adr[index])
        return {
            joint: float(model.wrap_prm[first + n])
            for n, (_, joint) in enumerate(self._wraps(index))
        }

    def _objects(self, equality: int) -> list[tuple[str, int]]:
        """What an equality ties."""
        model, eq = self._model, mujoco.mjtEq
        site = model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE
        tied = {eq.mjEQ_JOINT: "joint", eq.mjEQ_TENDON: "tendon"}
        for kind in (eq.mjEQ_CONNECT, eq.mjEQ_WELD):
            tied[kind] = "site" if site else "body"
        kind = tied.get(eq(int(model.eq_type[equality])))
        numbers = (int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality]))
        return [(kind, number) for number in numbers if kind and number >= 0]

    def _is_own_equality(self, equality: int) -> bool:
        return any(self._is_own(*one) for one in self._objects(equality))

    def _ends(self, equality: int) -> str:
        """The names of what an equality ties."""
        told = self._objects(equality)
        return " with ".join(called(self._model, *one) for one in told)
