"""A skill of your own: wave with the left hand. It is a coroutine; every await gives the tick back."""

from __future__ import annotations

from dataclasses import dataclass

from golem.runtime.lockstep import build
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.stack import load_stack


@dataclass(frozen=True)
class GreetGoal:
    times: int = 2


class Greet:
    """Open and close the left hand a few times."""

    async def run(self, context: Context, goal: GreetGoal) -> SkillResult:
        hand = context.hands["left"]
        for i in range(goal.times):
            context.say("greet", f"Greeting, {i + 1} of {goal.times}.")
            hand.open(0.1)
            await context.sleep(0.4)
            hand.close(4.0)
            await context.sleep(0.4)
        return SkillResult(True, "done", None, f"Greeted {goal.times} times.")


def main() -> None:
    running, robot = build(load_stack("tether", profile="ideal"), seed=0)
    result = running.execute(Greet(), GreetGoal())
    robot.close()
    print(f"{result.reason} {running.executor.t:.1f} s of robot time.")


if __name__ == "__main__":
    main()
