"""Whether a machine that could be read makes sense as a mechanism, said in words.

Everything here is about the nominal machine: the faults are those of a description, not of a part.
"""

from collections.abc import Callable

import numpy as np

from calib.arrays import Array, Numbers
from calib.errors import BadInput
from calib.mechanism.closure import Closure, passive_twists
from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import Poses, from_euler, logarithm, product
from calib.mechanism.solve import home_configuration, inverse, settle_limbs
from calib.mechanism.survey import Survey, closure_at, survey, unit_rows
from calib.mechanism.sweep import Standing
from calib.mechanism.task import task_rows, task_values
from calib.toml_place import line_of

IDLE = 1e-9
"""Singular values below this part of the largest are an idle freedom."""
HOME_TOLERANCE = 0.01
"""How far, as a part of the machine's size or in rad, the closed home may be from the stated."""
SINGULAR = 1e-6
UNSEEN = 1e-9
"""A parameter whose sigma moves the platform less than this many mm is seen by no reading."""

Place = Callable[..., str]


def require_sound(machine: Machine, text: str = "") -> Survey:
    """Raise for the first fault of a machine; what was seen of its workspace if it has none.

    Parameters
    ----------
    machine : Machine
    text : str, optional
        The machine file's text, so that a fault is named with its line.

    Raises
    ------
    BadInput
        A limb with an idle freedom or with too many joints, a platform that is not held, redundant
        rows without compliance, a compliance that leaves a wrench rigid, a chain that does not
        close, a home that is another branch, dependent actuators, a parameter that no reading can
        see, a workspace that is out of reach or contains a singularity.
    """

    def place(*keys: str) -> str:
        if text:
            return f"{machine.source}, line {line_of(text, *keys)}"
        return f"{machine.source}, [{'.'.join(keys)}]" if keys else machine.source

    _joint_counts(machine, place)
    _idle_freedoms(machine, place)
    _compliances(machine, place)
    _home(machine, place)
    _actuators(machine, place)
    seen = survey(machine)
    _singular_workspace(machine, seen, place)
    _unseen_parameters(machine, seen, place)
    return seen


def describe_twist(twist: Array) -> str:
    """A motion (6,) [v / size; omega] in words: its largest parts."""
    names = ("shift along x", "shift along y", "shift along z",
             "turn about x", "turn about y", "turn about z")  # fmt: skip
    size = np.abs(twist) / np.max(np.abs(twist))
    return " with ".join(names[k] for k in np.argsort(-size) if size[k] > 0.3)


def _joint_counts(machine: Machine, place: Place) -> None:
    for limb in machine.limbs:
        if len(limb.joints) > 6:
            raise BadInput(
                f"limb {limb.name} has {len(limb.joints)} passive joints: it holds nothing",
                place=place("limbs", limb.name),
                remedy="A limb holds the platform in 6 less its passive joints; remove some.",
            )
    held = compile_machine(machine).wrenches
    if held < 6:
        raise BadInput(
            f"the limbs hold {held} of the platform's 6 freedoms: it moves with all actuators held",
            place=place("limbs"),
            remedy="Remove passive joints, drive one more joint, or add a limb.",
        )


def _home_state(machine: Machine, shake: float) -> Standing:
    """Stated home with the rough joint angles, moved by a fixed pattern of size ``shake`` rad."""
    compiled = compile_machine(machine)
    pattern = np.sin(1.0 + 2.4 * np.arange(compiled.joint_count))
    units = np.array([1.0 if joint.turns else machine.size for joint in machine.joints])
    return Standing(
        np.array(machine.home[:3])[:, None],
        from_euler(*np.array(machine.home[3:]))[:, :, None],
        (compiled.joint_start + shake * pattern * units)[:, None],
        [np.zeros((len(g.compliant), g.count, 1)) for g in compiled.groups],
    )


def _idle_freedoms(machine: Machine, place: Place) -> None:
    """Joints that move together without moving the limb's end, wherever the limb stands."""
    extension = machine.extension(machine.home_q[:, None])
    best: dict[int, tuple[float, Array]] = {}
    with np.errstate(all="ignore"):
        for shake in (0.0, 0.1, 0.3):
            state = _home_state(machine, shake)
            closure = Closure(machine, machine.nominal[:, None], extension, state)
            for limb in closure.limbs:
                twists = passive_twists(closure, limb)
                for k, index in enumerate(limb.group.limbs):
                    if twists.shape[1]:
                        best[index] = max(
                            best.get(index, (-1.0, np.zeros(0))), _weakest(twists[:, :, k, 0]),
                            key=lambda found: found[0],
                        )  # fmt: skip
    for index, (ratio, motion) in best.items():
        if ratio < IDLE:
            idle = machine.limbs[index]
            names = [idle.joints[j].name for j in np.flatnonzero(np.abs(motion) > 1e-3)]
            raise BadInput(
                f"limb {idle.name} has an idle freedom: its joints {', '.join(names)} move "
                "together without moving its end",
                place=place("limbs", idle.name),
                remedy="Remove one of them (a rod between two ball joints is S and U, not S and "
                "S), or turn the axes apart with a rough angle in brackets: Rx(20d).",
            )


def _weakest(twists: Array) -> tuple[float, Array]:
    _, values, motions = np.linalg.svd(twists, full_matrices=False)
    return float(values[-1] / values[0]), motions[-1]


def _compliances(machine: Machine, place: Place) -> None:
    compiled = compile_machine(machine)
    if not compiled.redundant:
        return
    spare = compiled.wrenches - 6
    stiff = [
        limb.name
        for group in compiled.groups
        for limb in (machine.limbs[i] for i in group.limbs)
        if group.wrenches and not group.compliant
    ]
    if stiff:
        raise BadInput(
            f"the limbs hold the platform {spare} times more than its 6 freedoms, and "
            f"{', '.join(stiff)} cannot yield: how they share what does not fit is not described",
            place=place("limbs", stiff[0]),
            remedy="Put compliances in the chain where the limb is softest: ctz:1e-5 (mm/N) along "
            "a rod, crx:1e-8 (rad/(N mm)) at a hinge.",
        )
    extension = machine.extension(machine.home_q[:, None])
    with np.errstate(all="ignore"):
        closure = Closure(machine, machine.nominal[:, None], extension, _home_state(machine, 0.1))
    for limb in closure.limbs:
        for k, index in enumerate(limb.group.limbs):
            if limb.triangle is None or not limb.group.wrenches:
                continue
            diagonal = np.diagonal(limb.triangle[:, :, k, 0])
            if np.all(diagonal > 1e-7 * np.sqrt(np.max(limb.group.compliances[:, k]))):
                continue
            raise BadInput(
                f"the compliances of limb {machine.limbs[index].name} leave it rigid against a "
                "force or couple that it carries: it would take all of what does not fit",
                place=place("limbs", machine.limbs[index].name),
                remedy=f"It carries {limb.group.wrenches} wrenches and yields in "
                f"{len(limb.group.compliant)} places; let it yield along each of them.",
            )


def _home(machine: Machine, place: Place) -> None:
    settled = _settled(machine)
    home = home_configuration(machine)
    worst = _misfits(machine, settled)
    at_home = closure_at(machine, home) if home.converged[0] else settled
    rows = unit_rows(at_home)[0]
    stiffness, motion = _softest(rows) if np.all(np.isfinite(rows)) else (1.0, np.zeros(6))
    if stiffness < SINGULAR and (home.converged[0] or not worst):
        raise BadInput(
            f"home is a singular pose: the platform can {describe_twist(motion)} with all "
            "actuators held",
            place=place("home"),
            remedy="Choose another home pose, or move the joints out of line.",
        )
    if not home.converged[0]:
        alone = "every limb reaches the home pose by itself, but not together"
        raise BadInput(
            f"the machine does not close at home: {worst or alone}",
            place=place("home"),
            remedy="Compare the frames of that limb with the others, the home pose with the home "
            "actuators, and give joints rough angles in brackets.",
        )
    shift = home.poses.position[:, 0] - np.array(machine.home[:3])
    stated = from_euler(*np.array(machine.home[3:]))[:, :, None]
    turn = logarithm(product(home.poses.rotation, np.swapaxes(stated, 0, 1)))[:, 0]
    if max(np.linalg.norm(shift) / machine.size, np.linalg.norm(turn)) > HOME_TOLERANCE:
        raise BadInput(
            f"at its home actuators the machine closes at {pose_in_file(home.poses)}, "
            f"{np.linalg.norm(shift):.3f} mm and {np.degrees(np.linalg.norm(turn)):.3f} deg from "
            f"the stated home pose{_needed(machine)}",
            place=place("home"),
            remedy="Take that home pose over, or correct the home actuators; if both are right, a "
            "limb has a wrong frame, or its rough joint angles choose another branch.",
        )


def pose_in_file(poses: Poses) -> str:
    """The first pose as a machine file states it under [home], with all that is not zero."""
    values = poses.to_xyz_rpy()[:, 0]
    parts = [f"{name} = {value:.9g}" for name, value in zip("xyz", values[:3], strict=True)]
    parts += [
        f'{name} = "{value:.9g} deg"'
        for name, value in zip(("rx", "ry", "rz"), np.degrees(values[3:]), strict=True)
    ]
    size = (1e-9 * max(1.0, float(np.abs(values[:3]).max())),) * 3 + (1e-7,) * 3
    shown = [part for part, value, least in zip(parts, values, size, strict=True)
             if abs(value) > least]  # fmt: skip
    return f"pose = {{ {', '.join(shown)} }}" if shown else "pose = {}"


def _softest(rows: Numbers) -> tuple[float, Array]:
    _, values, motions = np.linalg.svd(rows)
    return float(values[-1] / values[0]), motions[-1]


def _needed(machine: Machine) -> str:
    """Actuators that the stated home would need, where it can be reached at all."""
    stated = np.array(machine.home)[:, None]
    poses = type(home_configuration(machine).poses).from_xyz_rpy(stated)
    found = inverse(machine, task_values(machine.task, poses))
    if not found.converged[0]:
        return ""
    q = machine.coordinates(found.extension)[:, 0]
    pairs = zip(machine.actuators, q, strict=True)
    return "; there it needs " + ", ".join(f"{a.name} = {value:.6g}" for a, value in pairs)


def _settled(machine: Machine) -> Closure:
    """The closure with the platform at the stated home and every limb as near to it as it gets."""
    extension = machine.extension(machine.home_q[:, None])
    state = _home_state(machine, 0.0)
    for _ in range(4):
        settle_limbs(machine, extension, state)
    with np.errstate(all="ignore"):
        return Closure(machine, machine.nominal[:, None], extension, state)


def _misfits(machine: Machine, settled: Closure) -> str:
    """How far the ends of the worst limbs stay from the stated home pose; "" for those that fit."""
    found: list[tuple[float, float, str]] = []
    for limb in settled.limbs:
        for k, index in enumerate(limb.group.limbs):
            shift = float(np.linalg.norm(limb.gap[:3, k, 0])) * machine.size
            turn = float(np.degrees(np.linalg.norm(limb.gap[3:, k, 0])))
            found.append((shift, turn, machine.limbs[index].name))
    found.sort(key=lambda f: -(f[0] / machine.size + np.radians(f[1])))
    shift, turn, name = found[0]
    if not shift > 1e-6 * machine.size and not turn > 1e-4:
        return ""
    worst = f"limb {name} ends {shift:.3f} mm and {turn:.3f} deg from the stated home pose"
    if len(found) > 1:
        worst += f" (next: {found[1][2]}, {found[1][0]:.3f} mm and {found[1][1]:.3f} deg)"
    return worst


def _actuators(machine: Machine, place: Place) -> None:
    """Actuators must move the commanded coordinates independently at home or nearby."""
    home = home_configuration(machine)
    moves = pose_jacobians(machine, home).actuators[:, :, 0]
    task = task_rows(machine.task, home.poses.rotation)[:, :, 0]
    answer = task @ moves.T
    for k, actuator in enumerate(machine.actuators):
        if not np.any(np.abs(moves[k]) > 1e-9):
            raise BadInput(
                f"actuator {actuator.name} does not move the platform at home",
                place=place("actuators", actuator.name),
                remedy="Its joint is in line with a passive one, or the home pose is singular.",
            )
    scale = np.where(np.abs(answer).max(axis=1) > 0.0, np.abs(answer).max(axis=1), 1.0)
    _, values, motions = np.linalg.svd(answer / scale[:, None])
    if values[-1] < SINGULAR * values[0]:
        names = [machine.actuators[k].name for k in np.flatnonzero(np.abs(motions[-1]) > 1e-3)]
        raise BadInput(
            f"{', '.join(names)} move together without moving "
            f"{', '.join(machine.task.coordinates)} at home",
            place=place("task"),
            remedy="The commanded coordinates do not follow from the actuators: check [task], "
            "whether one actuator drives two limbs by mistake, and the home pose.",
        )


def _singular_workspace(machine: Machine, seen: Survey, place: Place) -> None:
    if machine.workspace and not np.any(seen.usable):
        raise BadInput(
            f"none of {len(seen.usable)} poses of the workspace can be reached "
            f"({np.count_nonzero(seen.reached)} close, but outside strokes or joint limits)",
            place=place("workspace"),
            remedy="Correct the workspace, the actuators' limits or the joints' limits.",
        )
    crossed = np.flatnonzero(
        (seen.side != seen.side[0]) | (seen.stiffness < 1e-3 * seen.stiffness[0])
    )
    if crossed.size:
        values = task_values(machine.task, seen.configuration.poses)[:, crossed[0]]
        raise BadInput(
            f"the workspace contains a singularity between home and {_pose_text(machine, values)}: "
            "there the platform moves with all actuators held",
            place=place("workspace"),
            remedy="Narrow the workspace or the strokes so that it stays on home's side.",
        )


def _pose_text(machine: Machine, values: Array) -> str:
    parts = []
    for name, value in zip(machine.task.coordinates, values, strict=True):
        length = name in ("x", "y", "z")
        parts.append(
            f"{name} {value if length else np.degrees(value):.1f}{'' if length else ' deg'}"
        )
    return ", ".join(parts)


def _unseen_parameters(machine: Machine, seen: Survey, place: Place) -> None:
    for parameter, effect in zip(machine.parameters, seen.effect, strict=True):
        if effect < UNSEEN:
            limb, _, name = parameter.name.rpartition(".")
            own = any(limb == b.name for b in machine.limbs)
            keys = ("limbs", limb, name) if own else ("parameters", parameter.name)
            raise BadInput(
                f"no reading can see parameter {parameter.name}: its tolerance moves the platform "
                "nowhere",
                place=place(*keys),
                remedy="It stands along or about a passive joint; make it a constant, or put it "
                "where it has an effect.",
            )
