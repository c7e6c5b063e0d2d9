"""Reads every URDF and MJCF file below a folder as `golem model spheres` does, and prints a table of what became of it.

The poses of the links are compared with those of Pinocchio (URDF) and MuJoCo (MJCF) at random postures.

    python scripts/robot_files.py FOLDER [--geometry collision] [--package NAME=FOLDER ...] [--skip random_urdfs ...]
"""

from __future__ import annotations

import argparse
import contextlib
import os
from collections import Counter
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from golem.errors import GolemError
from golem.evaluation.spheres.link_poses import link_poses
from golem.evaluation.spheres.mesh_file import package_folders
from golem.evaluation.spheres.robot_geometry import RobotGeometry, read_geometry
from golem.robots.model.link_geometry import free_links, joint_value
from golem.robots.mujoco.geom_mesh import pose_matrix
from golem.types import Array

SAME = 1e-9
"""Largest difference between two poses [m] [own]."""
POSTURES = 5


def postures(robot: RobotGeometry) -> list[dict[str, float]]:
    """Return random positions of the free joints, the same each time."""
    rng = np.random.default_rng(0)
    return [
        {link.joint: float(rng.uniform(link.lower, link.upper)) for link in free_links(robot.links)}
        for _ in range(POSTURES)
    ]


def positions(robot: RobotGeometry, q: dict[str, float]) -> dict[str, float]:
    """Return the position of every joint, those that follow others included."""
    return {link.joint: joint_value(link, q) for link in robot.links if link.kind != "fixed"}


def by_pinocchio(robot: RobotGeometry, file: Path) -> list[dict[str, Array]]:
    """Return the (4, 4) pose of each link in the base, by its name, at each of `postures`."""
    model = pin.buildModelFromUrdf(str(file))
    data, found = model.createData(), []
    for q in postures(robot):
        x = pin.neutral(model)
        for name, value in positions(robot, q).items():
            if not model.existJointName(name):
                continue
            joint = model.joints[model.getJointId(name)]
            x[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        pin.framesForwardKinematics(model, data, x)
        found.append(
            {
                frame.name: data.oMf[i].homogeneous
                for i, frame in enumerate(model.frames)
                if frame.type == pin.FrameType.BODY
            }
        )
    return found


def root_pose(model: mujoco.MjModel, data: mujoco.MjData, robot: RobotGeometry) -> Array:
    """Return the (4, 4) pose of the base that `robot` has: its only root, before any hinge of that, or the world."""
    roots = [body for body in range(1, model.nbody) if model.body_parentid[body] == 0]
    if len(roots) != 1 or robot.links[0].name == "world":
        return np.eye(4)
    first = model.body_jntadr[roots[0]]
    free = first >= 0 and model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE
    if not free:
        return pose_matrix(model.body_pos[roots[0]], model.body_quat[roots[0]])
    return pose_matrix(data.xpos[roots[0]], data.xquat[roots[0]])


def by_mujoco(robot: RobotGeometry, file: Path) -> list[dict[str, Array]]:
    """Return what `by_pinocchio` returns, of an MJCF file."""
    model = mujoco.MjModel.from_xml_path(str(file))
    data, found = mujoco.MjData(model), []
    for q in postures(robot):
        mujoco.mj_resetData(model, data)
        for name, value in positions(robot, q).items():
            with contextlib.suppress(KeyError):
                data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_kinematics(model, data)
        poses = {}
        for body in range(1, model.nbody):
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
            poses[model.body(body).name] = T
        base = np.linalg.inv(root_pose(model, data, robot))
        found.append({name: base @ T for name, T in poses.items()})
    return found


def difference(robot: RobotGeometry, file: Path) -> float:
    """Return the largest difference of a number of a pose; nan where the other software does not read the file."""
    try:
        others = (by_pinocchio if b"<robot" in file.read_bytes() else by_mujoco)(robot, file)
    except Exception:  # whatever the other software makes of it
        return float("nan")
    worst = 0.0
    for q, other in zip(postures(robot), others, strict=True):
        own = link_poses(robot.links, np.array(list(q.values())))
        pairs = [(T, other[link.name]) for link, T in zip(robot.links, own, strict=True) if link.name in other]
        worst = max(worst, *(float(np.abs(a - b).max()) for a, b in pairs)) if pairs else worst
    return worst


def main() -> None:
    """Read the files and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--geometry", choices=("visual", "collision"), default="visual")
    parser.add_argument("--package", nargs="*", default=())
    parser.add_argument("--skip", nargs="*", default=())
    options = parser.parse_args()
    packages, counts = package_folders(tuple(options.package)), Counter[str]()
    files = [*options.folder.rglob("*.urdf"), *options.folder.rglob("*.xml")]
    os.environ["TQDM_DISABLE"] = "1"
    worst, compared = 0.0, 0
    for file in sorted(files):
        text = file.read_bytes()
        if any(word in str(file) for word in options.skip) or not (b"<robot" in text or b"<mujoco" in text):
            continue
        kind = "URDF" if file.suffix == ".urdf" else "MJCF"
        try:
            robot = read_geometry(file, options.geometry, packages)
        except GolemError as error:
            counts[f"{kind} refused"] += 1
            print(f"refused  {file}: {str(error)[:400]}", flush=True)
            continue
        except Exception as error:
            counts[f"{kind} WRONG"] += 1
            print(f"WRONG    {file}: {type(error).__name__} {error}", flush=True)
            continue
        off = difference(robot, file)
        wrong = off > SAME
        compared += off == off
        worst = max(worst, off) if off == off else worst
        counts[f"{kind} {'WRONG' if wrong else 'read'}"] += 1
        bare = sum(not link.parts for link in robot.links)
        print(
            f"{'WRONG   ' if wrong else 'read    '} {file}: {len(robot.links)} links, {bare} without a surface, "
            f"{len(free_links(robot.links))} joints, off by {off:.1e}",
            flush=True,
        )
    for what, count in sorted(counts.items()):
        print(f"{count:6d}  {what}")
    print(f"{compared} compared, the largest difference {worst:.1e}")


if __name__ == "__main__":
    main()
