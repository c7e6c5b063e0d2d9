"""One public walking policy of the H1-2, written as five trainers write theirs: soundly, or with a planted mistake.

The weights are read from the checkpoint of unitree_rl_gym (`shared`), which is a zip file: torch is not needed. The
network is written anew for what each format shows: joints in another order, histories, a quaternion for gravity.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from tests.capabilities.legs.onnx_writer import Graph

from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS

PEERS = Path(__file__).resolve().parents[4] / "shared" / "h12" / "peers"
GYM, ALMI = PEERS / "unitree_rl_gym" / "motion.pt", PEERS / "almi_open" / "policy_lstm_12800.pt"
LEG_JOINTS = JOINT_NAMES[LEGS]
ISAAC_LEGS = tuple(name for pair in zip(LEG_JOINTS[:6], LEG_JOINTS[6:], strict=True) for name in pair)
"""Left and right alternate, as Isaac counts joints breadth first."""
ARMS = [
    f"{s}_{j}"
    for j in (
        "shoulder_pitch_joint",
        "shoulder_roll_joint",
        "shoulder_yaw_joint",
        "elbow_joint",
        "wrist_roll_joint",
        "wrist_pitch_joint",
        "wrist_yaw_joint",
    )
    for s in ("left", "right")
]
ISAAC_ALL = (*ISAAC_LEGS[:2], "torso_joint", *ISAAC_LEGS[2:], *ARMS)
POSTURE = dict(zip(LEG_JOINTS, [0, -0.16, 0, 0.36, -0.2, 0] * 2, strict=True))
KP = dict(zip(LEG_JOINTS, [200.0, 200, 200, 300, 40, 40] * 2, strict=True))
KD = dict(zip(LEG_JOINTS, [2.5, 2.5, 2.5, 4, 2, 2] * 2, strict=True))
RATE_SCALE, COMMAND_SCALE, SPEED_SCALE, ACTION_SCALE = 0.25, [2.0, 2.0, 0.25], 0.05, 0.25


@dataclass(frozen=True)
class Wanted:
    """How the network is to be written.

    Attributes:
        joints: order of joints in observation and action; those of the upper body are seen by nothing and get 0.
        history: ticks shown.
        frames: whether they are laid out by ticks, or by terms.
        newest_first: whether the present tick comes first.
        quaternion: w, x, y, z in the place of gravity.
        velocity: whether the base's velocity comes first, as with mjlab.
    """

    joints: tuple[str, ...] = LEG_JOINTS
    history: int = 1
    frames: bool = False
    newest_first: bool = False
    quaternion: bool = False
    velocity: bool = False


def weights(path: Path, seen: int, hidden: tuple[int, ...]) -> list[np.ndarray]:
    """Return the weights of a checkpoint: each layer's and its bias, then those of its LSTM of 64 cells."""
    if not path.is_file():
        pytest.skip(f"the checkpoint {path.name} is absent")
    layers = zip((64, *hidden), (*hidden, 12), strict=True)
    shapes = [shape for n, m in layers for shape in ((m, n), (m,))] + [(256, seen), (256, 64), (256,), (256,)]
    with zipfile.ZipFile(path) as file:
        folder = file.namelist()[0].split("/")[0]
        read = [np.frombuffer(file.read(f"{folder}/data/{k + 2}"), np.float32) for k in range(len(shapes))]
    return [values.reshape(shape) for values, shape in zip(read, shapes, strict=True)]


def recurrent(g: Graph, seen: str, w: list[np.ndarray]) -> None:
    """Add the LSTM and the layers of `weights`, from `seen` (1, n) to `actions`."""
    # torch's gates are i, f, g, o; ONNX's i, o, f, c.
    W, R, bi, bh = (np.concatenate([q[0], q[3], q[1], q[2]]) for q in (np.split(x, 4) for x in w[-4:]))
    g.weight("W", W[None])
    g.weight("R", R[None])
    g.weight("B", np.concatenate([bi, bh])[None])
    g.weight("first", [0], whole=True)
    g.add("Unsqueeze", [seen, "first"], "sequence")
    g.add("LSTM", ["sequence", "W", "R", "B", "", "h_in", "c_in"], "all", "h_out", "c_out", hidden_size=64)
    x = g.add("Squeeze", ["h_out", "first"], "hidden")
    layers = (len(w) - 4) // 2
    for k in range(layers):
        g.weight(f"w{k}", w[2 * k].T)
        g.weight(f"b{k}", w[2 * k + 1])
        last = k == layers - 1
        x = g.add("Gemm", [x, f"w{k}", f"b{k}"], "actions" if last else f"inner{k}")
        x = x if last else g.add("Elu", [x], f"bent{k}")


def save(g: Graph, path: Path, seen: int, actions: int, notes: dict[str, str] | None = None) -> Path:
    """Write a recurrent network."""
    state = {"h": (1, 1, 64), "c": (1, 1, 64)}
    inputs = {"obs": (1, seen), **{f"{k}_in": shape for k, shape in state.items()}}
    outputs = {"actions": (1, actions), **{f"{k}_out": shape for k, shape in state.items()}}
    return g.save(path, inputs, outputs, notes)


def almi_open(folder: Path) -> Path:
    """Write ALMI-Open's network as it is, as ONNX; its description is shipped."""
    g = Graph()
    recurrent(g, "obs", weights(ALMI, 65, (64, 32)))
    return save(g, folder / "almi_open.onnx", 65, 12)


def write_network(path: Path, wanted: Wanted, notes: dict[str, str] | None = None) -> Path:
    """Write the network as `wanted`; a recurrent one with explicit state."""
    w, g = weights(GYM, 47, (32,)), Graph()
    n = len(wanted.joints)
    widths = [3] * wanted.velocity + [3, 4 if wanted.quaternion else 3, 3, n, n, n, 2]
    frame, H = sum(widths), wanted.history
    # Where the present tick stands in what the network is shown.
    newest = 0 if wanted.newest_first else H - 1
    starts = np.cumsum([0, *widths[:-1]])
    if wanted.frames:
        picks = np.arange(frame) + newest * frame
    else:
        picks = np.concatenate([s * H + newest * k + np.arange(k) for s, k in zip(starts, widths, strict=True)])
    g.weight("present", picks, whole=True)
    x = g.add("Gather", ["obs", "present"], "tick", axis=1)
    legs = [wanted.joints.index(name) for name in LEG_JOINTS]
    base = starts[1:] if wanted.velocity else starts
    parts = []
    for k, (start, picked) in enumerate(
        zip(base, [range(3), range(4 if wanted.quaternion else 3), range(3), legs, legs, legs, range(2)], strict=True)
    ):
        g.weight(f"pick{k}", [start + i for i in picked], whole=True)
        parts.append(g.add("Gather", [x, f"pick{k}"], f"part{k}", axis=1))
    if wanted.quaternion:
        parts[1] = _gravity(g, parts[1])
    out, bias = np.zeros((n, 32), np.float32), np.zeros(n, np.float32)
    out[legs], bias[legs] = w[2], w[3]
    w[2:4] = [out, bias]
    recurrent(g, g.add("Concat", parts, "seen", axis=1), w)
    return save(g, path, frame * H, n, notes)


def _gravity(g: Graph, quaternion: str) -> str:
    """Add nodes that turn w, x, y, z into gravity in the base: what the quaternion's inverse does to (0, 0, -1)."""
    for k, name in enumerate("wxyz"):
        g.weight(f"axis_{name}", [k], whole=True)
        g.add("Gather", [quaternion, f"axis_{name}"], name, axis=1)
    for a, b in ("xz", "wy", "yz", "wx", "xx", "yy"):
        g.add("Mul", [a, b], a + b)
    g.weight("two", [2.0])
    g.weight("minus_two", [-2.0])
    g.weight("minus_one", [-1.0])
    g.add("Sub", ["wy", "xz"], "gx_half")
    g.add("Mul", ["gx_half", "two"], "gx")
    g.add("Add", ["yz", "wx"], "gy_half")
    g.add("Mul", ["gy_half", "minus_two"], "gy")
    g.add("Add", ["xx", "yy"], "gz_half")
    g.add("Mul", ["gz_half", "two"], "gz_up")
    g.add("Add", ["gz_up", "minus_one"], "gz")
    return g.add("Concat", ["gx", "gy", "gz"], "gravity", axis=1)


def mjlab(folder: Path, wanted: Wanted = Wanted(ISAAC_LEGS), **changes: str) -> Path:
    """Write an ONNX network with mjlab's metadata; `changes` replace values."""
    names = wanted.joints
    terms = ["base_lin_vel"] * wanted.velocity + [
        "base_ang_vel",
        "projected_gravity",
        "command",
        "joint_pos",
        "joint_vel",
        "actions",
        "phase",
    ]
    if wanted.quaternion:
        terms[terms.index("projected_gravity")] = "root_quat_w"
    scale = {"base_ang_vel": RATE_SCALE, "command": f"[{COMMAND_SCALE[0]}, {COMMAND_SCALE[1]}, {COMMAND_SCALE[2]}]"}
    scale |= {"joint_vel": SPEED_SCALE}
    row = lambda values, rest: ",".join(f"{values.get(name, rest):.3f}" for name in names)  # noqa: E731
    notes = {
        "run_path": "none",
        "joint_names": ",".join(names),
        "joint_stiffness": row(KP, 100.0),
        "joint_damping": row(KD, 2.0),
        "default_joint_pos": row(POSTURE, 0.0),
        "command_names": "twist",
        "observation_names": ",".join(terms),
        "action_scale": ",".join([f"{ACTION_SCALE:.3f}"] * len(names)),
        "observation_terms_scale": ",".join(str(scale.get(name, 1.0)) for name in terms),
        "observation_terms_clip": ",".join(["-inf;inf"] * len(terms)),
        "observation_terms_history_length": ",".join([str(wanted.history if wanted.history > 1 else 0)] * len(terms)),
        "observation_terms_flatten_history_dim": ",".join(["1.000"] * len(terms)),
    }
    return write_network(folder / "policy.onnx", wanted, notes | changes)


def unitree_deploy(folder: Path, wanted: Wanted = Wanted(ISAAC_LEGS), edit: Any = None) -> Path:
    """Write a deploy.yaml beside its network; `edit` may change the mapping."""
    names, H = wanted.joints, wanted.history
    n = len(names)
    sdk = JOINT_NAMES[:n]

    def term(scale: list[float], **params: Any) -> dict[str, Any]:
        return {"params": params, "clip": None, "scale": scale, "history_length": H}

    data: dict[str, Any] = {
        "joint_ids_map": [JOINT_INDEX[name] for name in names],
        "step_dt": 0.02,
        "stiffness": [KP.get(name, 100.0) for name in sdk],
        "damping": [KD.get(name, 2.0) for name in sdk],
        "default_joint_pos": [POSTURE.get(name, 0.0) for name in names],
        "commands": {
            "base_velocity": {"ranges": {"lin_vel_x": [-0.8, 0.8], "lin_vel_y": [-0.5, 0.5], "ang_vel_z": [-1.0, 1.0]}}
        },
        "actions": {
            "JointPositionAction": {
                "clip": None,
                "joint_names": [".*"],
                "scale": [ACTION_SCALE] * n,
                "offset": [POSTURE.get(name, 0.0) for name in names],
                "joint_ids": None,
            }
        },
        "observations": {
            "base_ang_vel": term([RATE_SCALE] * 3),
            ("root_quat_w" if wanted.quaternion else "projected_gravity"): term([1.0] * (3 + wanted.quaternion)),
            "velocity_commands": term(COMMAND_SCALE, command_name="base_velocity"),
            "joint_pos_rel": term([1.0] * n),
            "joint_vel_rel": term([SPEED_SCALE] * n),
            "last_action": term([1.0] * n),
            "gait_phase": term([1.0] * 2, period=0.8),
        },
    }
    if wanted.frames:
        data["observations"]["use_gym_history"] = True
    if edit is not None:
        edit(data)
    (folder / "params").mkdir(exist_ok=True)
    (folder / "exported").mkdir(exist_ok=True)
    write_network(folder / "exported" / "policy.onnx", wanted)
    text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None)
    text = text.replace("joint_ids: null", "joint_ids: !!python/object/apply:builtins.slice [null, null, null]")
    path = folder / "params" / "deploy.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def isaac_lab(folder: Path, wanted: Wanted = Wanted(ISAAC_LEGS), edit: Any = None) -> Path:
    """Write Isaac Lab's descriptors beside the network; `edit` may change the mapping."""
    names = list(wanted.joints)
    n = len(names)
    functions = "isaaclab.envs.mdp.observations."

    def term(name: str, scale: Any = None, joints: bool = False) -> dict[str, Any]:
        more = {
            "clip": None,
            "flatten_history_dim": True,
            "history_length": wanted.history if wanted.history > 1 else 0,
            "scale": scale,
        }
        own = {"full_path": functions + name, "name": name, "overloads": more, "dtype": "torch.float32"}
        return own | ({"joint_names": list(names)} if joints else {})

    data: dict[str, Any] = {
        "actions": [
            {
                "action_type": "JointAction",
                "clip": None,
                "full_path": "isaaclab.envs.mdp.actions.joint_actions.JointPositionAction",
                "joint_names": list(names),
                "offset": [POSTURE.get(name, 0.0) for name in names],
                "scale": ACTION_SCALE,
                "shape": [n],
            }
        ],
        "articulations": {
            "robot": {
                "joint_names": list(names),
                "default_joint_pos": [POSTURE.get(name, 0.0) for name in names],
                "default_joint_stiffness": [KP.get(name, 100.0) for name in names],
                "default_joint_damping": [KD.get(name, 2.0) for name in names],
            }
        },
        "observations": {
            "policy": [
                term("base_ang_vel", RATE_SCALE),
                term("root_quat_w" if wanted.quaternion else "projected_gravity"),
                term("generated_commands", list(COMMAND_SCALE)),
                term("joint_pos_rel", joints=True),
                term("joint_vel_rel", SPEED_SCALE, joints=True),
                term("last_action"),
                term("gait_phase"),
            ]
        },
        "scene": {"decimation": 4, "dt": 0.02, "physics_dt": 0.005},
    }
    if edit is not None:
        edit(data)
    write_network(folder / "policy.onnx", wanted)
    path = folder / "IO_descriptors.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return path


def unitree_gym(folder: Path, edit: Any = None) -> Path:
    """Write unitree_rl_gym's YAML beside the network; `edit` may change the mapping."""
    data: dict[str, Any] = {
        "control_dt": 0.02,
        "policy_path": "{LEGGED_GYM_ROOT_DIR}/deploy/pre_train/h1_2/motion.onnx",
        "leg_joint2motor_idx": list(range(12)),
        "kps": list(KP.values()),
        "kds": list(KD.values()),
        "default_angles": list(POSTURE.values()),
        "ang_vel_scale": RATE_SCALE,
        "dof_pos_scale": 1.0,
        "dof_vel_scale": SPEED_SCALE,
        "action_scale": ACTION_SCALE,
        "cmd_scale": list(COMMAND_SCALE),
        "num_actions": 12,
        "num_obs": 47,
        "max_cmd": [0.8, 0.5, 1.57],
    }
    if edit is not None:
        edit(data)
    write_network(folder / "motion.onnx", Wanted())
    path = folder / "h1_2.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False, default_flow_style=None), encoding="utf-8")
    return path


def golem(folder: Path, wanted: Wanted = Wanted(), edit: Any = None) -> Path:
    """Write our own description beside the network; `edit` may change the mapping."""
    names, H = list(wanted.joints), wanted.history
    data: dict[str, Any] = {
        "network": "policy.onnx",
        "rate": 50,
        "envelope": {"vx": [-0.8, 0.8], "vy": [-0.5, 0.5], "wz": [-1.0, 1.0]},
        "gait": {"period": 0.8, "start": "always"},
        "posture": [0, -0.16, 0, 0.36, -0.2, 0],
        "kp": list(KP.values())[:6],
        "kd": list(KD.values())[:6],
        "action": {"scale": ACTION_SCALE},
        "joints": names[:],
        "observation": [
            {"term": "base_rate", "scale": RATE_SCALE, "history": H},
            {"term": "orientation" if wanted.quaternion else "gravity", "history": H},
            {"term": "twist", "scale": list(COMMAND_SCALE), "history": H},
            {"term": "joint_position", "of": names[:], "history": H},
            {"term": "joint_velocity", "of": names[:], "scale": SPEED_SCALE, "history": H},
            {"term": "last_action", "of": names[:], "history": H},
            {"term": "phase", "of": ["left_sin", "left_cos"], "history": H},
        ],
    }
    if wanted.frames:
        data["history"] = "frame"
    if wanted.newest_first:
        data["newest_first"] = True
    if edit is not None:
        edit(data)
    write_network(folder / "policy.onnx", wanted)
    path = folder / "policy.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False, default_flow_style=None), encoding="utf-8")
    return path


EVERYTHING = replace(Wanted(ISAAC_ALL), history=1)
assert len(ISAAC_ALL) == NUM_JOINTS
