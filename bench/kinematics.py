"""Kinematics of 1,000 hexapod poses: the generic engine, a hand-written closed form, Pinocchio.

Wanted: >= 10 times a Python loop over Pinocchio for the same open limbs, forward kinematics and
Jacobians together <= 40 us a pose, no slower than the closed form. One core.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core: before numpy is loaded

import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from app.files.machines import load_machine
from bench._hexapod_closed_form import HexapodClosedForm, PoseFirst
from calib.arrays import Array
from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.solve import Configuration, forward
from calib.mechanism.sweep import Standing, sweep, twists_of
from calib.poses import sample_poses

POSES, REPEATS = 1000, 7


def best_of(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest time of a call, us a pose."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times) / POSES * 1e6


class OpenLimbs:
    """The six limbs of the hexapod as one Pinocchio tree, one joint an elementary joint."""

    def __init__(self, machine: Machine) -> None:
        self.model = pin.Model()
        self.ends: list[int] = []
        self.order: list[tuple[str, int]] = []
        for limb in machine.limbs:
            parent, placement = 0, pin.SE3.Identity()
            for element in limb.elements:
                moving = [term for term in element.terms if term.kind != "parameter"]
                constant = element.constant + sum(
                    term.factor * machine.nominal[term.index]
                    for term in element.terms
                    if term.kind == "parameter"
                )
                placement = placement * _fixed(element.turns, element.axis, constant)
                if not moving:
                    continue
                kinds = ("RX", "RY", "RZ") if element.turns else ("PX", "PY", "PZ")
                joint = getattr(pin, f"JointModel{kinds[element.axis]}")()
                name = f"{limb.name}.{len(self.order)}"
                parent = self.model.addJoint(parent, joint, placement, name)
                placement = pin.SE3.Identity()
                self.order.append((moving[0].kind, moving[0].index))
            frame = pin.Frame(f"{limb.name}.end", parent, 0, placement, pin.FrameType.OP_FRAME)
            self.ends.append(self.model.addFrame(frame))
        self.data = self.model.createData()

    def coordinates(self, configuration: Configuration) -> Array:
        """Joint coordinates (N, n) of closed configurations."""
        held = {"passive": configuration.passive, "actuator": configuration.extension}
        return np.array([held[kind][index] for kind, index in self.order]).T.copy()

    def evaluate(self, q: Array) -> tuple[list[Array], list[Array]]:
        """End positions and Jacobians of all limbs, pose after pose."""
        places, jacobians = [], []
        model, data, world = self.model, self.data, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        for row in q:
            pin.computeJointJacobians(model, data, row)
            pin.updateFramePlacements(model, data)
            for frame in self.ends:
                places.append(data.oMf[frame].translation.copy())
                jacobians.append(pin.getFrameJacobian(model, data, frame, world))
        return places, jacobians


def _fixed(turns: bool, axis: int, value: float) -> pin.SE3:
    unit = np.eye(3)[axis]
    if turns:
        return pin.SE3(pin.AngleAxis(value, unit).toRotationMatrix(), np.zeros(3))
    return pin.SE3(np.eye(3), value * unit)


def open_limbs_ours(machine: Machine, configuration: Configuration) -> tuple[Array, Array]:
    """The same with the engine: end positions (3, L, N) and joint twists (6, joints, L, N)."""
    group = compile_machine(machine).groups[0]
    state = Standing.of(configuration)
    parameters = machine.nominal[:, None]
    point, _, screws = sweep(group, parameters, configuration.extension, state, state.strain[0])
    joints = [
        ((k, None),)
        for k, element in enumerate(group.elements)
        if any(term.kind != "parameter" for term in element.terms)
    ]
    origin = state.position[:, None]
    return point, twists_of(group, screws, joints, origin, 1.0, np.dtype(float))


def main() -> None:
    machine = load_machine("hexapod")
    poses = sample_poses(machine, POSES, np.random.default_rng(1))
    closed, extension = poses.configuration, poses.configuration.extension
    limbs, hand = OpenLimbs(machine), HexapodClosedForm(machine)
    q = limbs.coordinates(closed)

    places, jacobians = limbs.evaluate(q)
    point, twists = open_limbs_ours(machine, closed)
    ends = np.array(places).reshape(POSES, 6, 3).transpose(2, 1, 0)
    # Row i of a limb's Jacobian, its own six joints: (6, joints, limbs, poses) as ours.
    held = np.array(jacobians).reshape(POSES, 6, 6, 6, 6)
    loop = np.stack([held[:, i, :, i] for i in range(6)]).transpose(2, 3, 0, 1)
    print(
        f"Pinocchio and engine agree to {np.max(np.abs(ends - point)):.1e} mm, Jacobians to "
        f"{np.max(np.abs(loop - twists)):.1e}"
    )
    answer = hand.forward(extension)
    off = np.max(np.abs(answer.position - closed.poses.position))
    print(f"closed form and engine agree to {off:.1e} mm")
    J = pose_jacobians(machine, closed).parameters
    print(f"Jacobians agree to {np.max(np.abs(hand.jacobian(answer) - J)):.1e}")

    theirs = best_of(lambda: limbs.evaluate(q), 3)
    ours = best_of(lambda: open_limbs_ours(machine, closed))
    print(
        f"open limbs, ends and joint Jacobians: {ours:.1f} us a pose, Pinocchio in a loop "
        f"{theirs:.0f} us, ratio {theirs / ours:.1f} (want >= 10)"
    )
    solve = best_of(lambda: forward(machine, extension))
    differentiate = best_of(lambda: pose_jacobians(machine, closed))
    both = solve + differentiate
    print(
        f"closed machine: forward kinematics from home {solve:.1f} us, 6 x 54 Jacobian "
        f"{differentiate:.1f} us, together {both:.1f} us a pose (want <= 40), "
        f"{theirs / both:.1f} times the open limbs of Pinocchio alone"
    )
    usual = PoseFirst(machine)
    at = usual.forward(extension.T)
    off = np.max(np.abs(usual.jacobian(*at).transpose(2, 1, 0) - J))
    print(f"pose-first closed form agrees to {off:.1e}")
    for says, find, differ in (
        (
            "pose first, as usually written",
            lambda: usual.forward(extension.T),
            lambda: usual.jacobian(*at),
        ),
        (
            "component first, tuned",
            lambda: hand.forward(extension),
            lambda: hand.jacobian(answer),
        ),
    ):
        f, d = best_of(find), best_of(differ)
        print(
            f"hand-written closed form, {says}: {f:.1f} us and {d:.1f} us; engine / closed form "
            f"{solve / f:.2f} and {differentiate / d:.2f}, "
            f"together {both / (f + d):.2f} (want <= 1)"
        )


if __name__ == "__main__":
    main()
