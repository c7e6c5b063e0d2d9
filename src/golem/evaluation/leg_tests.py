"""What `golem bench legs` tests: standing, working, walking, stopping; one function per test, one robot per trial.

A test takes subject, seed and index of the trial, and returns its figures in SI units. Trial `i` of every subject
meets the same draws. A robot that is lost (fell, was stopped, or its controller failed) has the figures of `lost_in`
and none of how well it did until then: they would flatter it.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from contextlib import closing

import numpy as np

from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.mpc.controller import MPC, MPCConfig
from golem.evaluation.episodes.episode import Episode, episode_seed
from golem.evaluation.episodes.odometry import SimulatedOdometry
from golem.evaluation.episodes.scripted_motion import WIDE_AREA, ArmMotion, ScriptedMotion
from golem.evaluation.speed.bench import stopwatch
from golem.evaluation.subject import Subject
from golem.options import fill
from golem.robots.mujoco.shoves import DIRECTIONS, shove
from golem.skills.walk import Walk, WalkGoal
from golem.types import PlanarPose, Twist

Figures = dict[str, float]
LOST = "lost_in_"
"""Prefix of the figure that counts a stage in which robots were lost."""
DOES_NOT_WALK: Figures = {"lost": 0.0, "does_not_walk": 1.0}
"""Figures of a lower body that was not tested, because it only stands."""
SETTLE = 3.0
"""Time between a robot carrying its weight and the test [s]: what the release of its band set off has died away."""
CALM = 10.0
"""The same for the test of quiet standing [s]: a policy takes 5 s over the last centimetre back from the release."""
MINUTE = 60.0
"""Length of the tests of standing and of one piece of endurance [s]."""
PAYLOAD = (1.0, 1.0)
"""Mass in the left and the right hand while the arms sweep [kg]."""
COMMAND, COUNTED = 7.0, 4.0
"""How long one twist is commanded, and the last part of it that is counted [s]: whole gait cycles, nearly."""
ROUGH = Twist(vx=0.4)
"""Twist on slope and rubble."""
ROUGH_TIME = 10.0
"""Time it is commanded [s]: ramp and tiles begin a metre ahead and end after three more."""
MAX_SHOVE = 30.0
"""Largest push of the endurance test [N s]."""
PATIENCE = 4.0
"""Time after its last push that has to be survived, too [s]."""
GOAL_DISTANCE = (1.8, 2.2)
"""Distance of the goals of the test of stopping [m]."""
GOAL_TURN = 0.6
"""Largest turn to the final heading of such a goal [rad]."""
GOAL_TIMEOUT = 40.0
"""Time to stop at a goal [s]."""
AFTER = 1.0
"""Time after the skill's end until the pose is judged [s]."""
PLANNED = 10.0
"""Length of the test of the planner's rate [s]."""
SAMPLES = (8, 12, 16, 24, 32)
"""Samples per plan of the test of the planner's rate."""


def quiet(subject: Subject, seed: int, index: int) -> Figures:
    """Stand still for a minute: base range, sway, steps, margin."""
    with closing(subject.episode(seed, index)) as episode:
        return _minute(episode, CALM)


def arms(subject: Subject, seed: int, index: int) -> Figures:
    """Stand for a minute while both arms sweep their workspace with a kilogram in each hand."""
    with closing(subject.episode(seed, index, payload=PAYLOAD)) as episode:
        draw = subject.draw(seed, index)
        episode.start(ScriptedMotion(ArmMotion(draw.rng("arms"), WIDE_AREA)))
        return _minute(episode, SETTLE)


def _minute(episode: Episode, settle: float) -> Figures:
    """Let the robot stand for a minute once it has settled for `settle` [s]; return how it stood."""
    episode.stand(settle)
    start = episode.t
    episode.run(MINUTE)
    return _lost(episode) if episode.over else _standing(episode, start) | _lost(episode)


def tracking(subject: Subject, seed: int, index: int) -> Figures:
    """Walk with one twist of the declared envelope: error of the mean velocity over the last seconds, per axis."""
    with closing(subject.episode(seed, index)) as episode:
        envelope = episode.running.envelope
        if not can_walk(envelope):
            return DOES_NOT_WALK
        twist = command(envelope, subject.draw(seed, index).rng("twist"), index)
        asked = np.array([twist.vx, twist.vy, twist.wz])
        episode.stand(SETTLE)
        episode.start(ScriptedMotion(twist=lambda t: twist))
        episode.run(COMMAND)
        figures = dict(zip(("vx", "vy", "wz"), asked.tolist(), strict=True)) | _lost(episode)
        if not episode.over:
            walked = episode.recorder.trace().window(episode.t - COUNTED)
            error = np.abs(walked.twist.mean(axis=0) - asked)
            figures |= dict(zip(("error_vx", "error_vy", "error_wz"), error.tolist(), strict=True))
            figures["error_speed"] = float(np.hypot(error[0], error[1]))
        return figures


def endurance(subject: Subject, seed: int, index: int) -> Figures:
    """Walk at random for a minute, arms moving, shoved with up to 30 N s every few seconds."""
    draw = subject.draw(seed, index)
    rng, shoves = draw.rng("twists"), draw.rng("shoves")
    with closing(subject.episode(seed, index)) as episode:
        envelope = episode.running.envelope
        if not can_walk(envelope):
            return DOES_NOT_WALK
        script = [(0.0, Twist())]
        while script[-1][0] < MINUTE:
            still = rng.random() < 0.2
            script.append((script[-1][0] + rng.uniform(3.0, 6.0), _random(envelope, rng, still)))
        exercise = ScriptedMotion(ArmMotion(draw.rng("arms")))
        episode.start(exercise)
        episode.stand(SETTLE)
        start = episode.t
        # The exercise counts from its own begin.
        exercise.twist = lambda t: [twist for at, twist in script if at <= episode.t - start][-1]
        count = 0
        while episode.t < start + MINUTE - 1e-6 and not episode.over:
            episode.run(min(shoves.uniform(4.0, 8.0), start + MINUTE - episode.t))
            if episode.t < start + MINUTE - 1e-6 and not episode.over:
                episode.push(shove(DIRECTIONS[shoves.integers(8)], shoves.uniform(0.0, MAX_SHOVE)))
                count += 1
        seconds = episode.t - start
        episode.run(PATIENCE)
        return {"seconds": seconds, "pushes": float(count)} | _lost(episode)


def slope(subject: Subject, seed: int, index: int) -> Figures:
    """Walk ahead and up a ramp of 5 deg."""
    return _rough(subject, seed, index, "slope")


def rubble(subject: Subject, seed: int, index: int) -> Figures:
    """Walk ahead over tiles of uneven height, up to 3 cm."""
    return _rough(subject, seed, index, "rubble")


def stopping(subject: Subject, seed: int, index: int) -> Figures:
    """Walk to a pose 2 m away and stand there, by the base estimator with 1 cm and 1 deg of noise: the true error."""
    draw = subject.draw(seed, index)
    rng = draw.rng("goal")
    bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(*GOAL_DISTANCE)
    goal = PlanarPose(
        distance * math.cos(bearing), distance * math.sin(bearing), rng.uniform(-GOAL_TURN, GOAL_TURN)
    )
    with closing(subject.episode(seed, index)) as episode:
        if not can_walk(episode.running.envelope):
            return DOES_NOT_WALK
        episode.locate(
            SimulatedOdometry(episode.running.bus, episode.robot, "estimator", draw.rng("odometry"))
        )
        episode.stand(SETTLE)
        if episode.over:
            return _lost(episode)
        episode.start(
            Walk(episode.running.navigator), WalkGoal(goal.x, goal.y, goal.yaw, "odom", GOAL_TIMEOUT)
        )
        episode.run(GOAL_TIMEOUT + 1.0, until=lambda: episode.result is not None)
        episode.run(AFTER)
        truth, result = episode.robot.truth, episode.result
        figures = _lost(episode)
        if episode.over or result is None:
            return figures
        left = goal.to(PlanarPose.of(np.linalg.inv(truth.T_world_odom) @ truth.base().T_world_base))
        return figures | {
            "arrived": float(result.success),
            "error": math.hypot(left.x, left.y),
            "error_x": left.x,
            "error_y": left.y,
            "error_yaw": left.yaw,
            "seconds": result.timings.get("walk", GOAL_TIMEOUT),
        }


def plans(subject: Subject, seed: int, index: int) -> Figures:
    """Stand for 10 s with an MPC of so many samples: plans per second on this machine's cores, and whether it stands.

    In lock-step a plan is there after the latency the controller declares, however long it took; it stands in real time
    where it stands and 95 of 100 plans take no longer than that, nor than the time between two.
    """
    samples = SAMPLES[index % len(SAMPLES)]
    stack = subject.stack()
    options = dict(stack.choice("lower_body").options)
    options["planner"] = {**options.get("planner", {}), "samples": samples}
    stack = stack.with_options("lower_body", planner=options["planner"])
    config: MPCConfig = fill("option of lower_body: mpc", MPCConfig, options)
    allowed = min(config.latency, 1.0 / config.plan_rate)
    with closing(Episode(stack, episode_seed(seed, index))) as episode:
        with (
            stopwatch(MPC, "plan", time.perf_counter) as wall,
            stopwatch(MPC, "plan", time.process_time) as cpu,
        ):
            episode.stand(SETTLE)
            episode.run(PLANNED)
        if not wall:
            return _lost(episode)
        in_time = float((np.array(wall) <= allowed).mean())
        stands = in_time >= 0.95 and not episode.over
        return {
            f"plans_per_second_{samples}": 1.0 / float(np.median(wall)),
            f"in_time_{samples}": in_time,
            f"cpu_per_plan_{samples}": float(np.median(cpu)),
            f"stands_{samples}": float(not episode.over),
            f"stands_in_real_time_{samples}": float(stands),
        } | _lost(episode)


def lost_in(stage: str) -> Figures:
    """Return the figures of a robot that was lost in `stage`."""
    return {"lost": 1.0, f"{LOST}{stage}": 1.0}


def command(envelope: Envelope, rng: np.random.Generator, index: int) -> Twist:
    """Return twist `index` of the test of tracking: the 26 ends, edges and corners of the envelope, then draws."""
    axes = [(low, 0.0, high) for low, high in (envelope.vx, envelope.vy, envelope.wz)]
    corners = [c for c in dict.fromkeys(itertools.product(*axes)) if any(c)]
    corners.sort(key=np.count_nonzero)  # first along one axis: who asks for few trials shall see each
    return Twist(*corners[index]) if index < len(corners) else _random(envelope, rng, still=False)


def can_walk(envelope: Envelope) -> bool:
    """Return whether a lower body follows any twist at all."""
    return any(envelope.axes)


def _random(envelope: Envelope, rng: np.random.Generator, still: bool) -> Twist:
    drawn = [float(rng.uniform(low, high)) for low, high in (envelope.vx, envelope.vy, envelope.wz)]
    return Twist() if still else Twist(*drawn)


def _rough(subject: Subject, seed: int, index: int, world: str) -> Figures:
    with closing(subject.episode(seed, index, world=world)) as episode:
        if not can_walk(episode.running.envelope):
            return DOES_NOT_WALK
        episode.stand(SETTLE)
        start = episode.t
        episode.start(ScriptedMotion(twist=lambda t: ROUGH))
        episode.run(ROUGH_TIME)
        if episode.over:
            return _lost(episode)
        path = episode.recorder.trace().window(start).base
        climbed, moved = path[-1, 2] - path[0, 2], np.hypot(*(path[-1] - path[0])[:2])
        return {"distance": float(moved), "climbed": float(climbed)} | _lost(episode)


def _standing(episode: Episode, start: float) -> Figures:
    stood = episode.recorder.trace().window(start)
    return {
        "base_range": stood.base_range,
        "sway": stood.sway,
        "steps": float(stood.steps),
        "margin_median": float(np.median(stood.margin)),
        "margin_min": float(stood.margin.min()),
        "never_negative": float(stood.margin.min() >= 0.0),
        "share_not_negative": float((stood.margin >= 0.0).mean()),
    }


def _lost(episode: Episode) -> Figures:
    return {"lost": 0.0} if episode.loss is None else lost_in(episode.loss.stage)


MISSED: dict[str, Figures] = {
    **dict.fromkeys((quiet.__name__, arms.__name__), {"never_negative": 0.0}),
    stopping.__name__: {"arrived": 0.0},
}
"""Figures by which a robot that is lost counts among those that did not do what a test asks for."""
TESTS: dict[str, Callable[[Subject, int, int], Figures]] = {
    test.__name__: test for test in (quiet, arms, tracking, endurance, slope, rubble, stopping, plans)
}
"""Test by name."""
