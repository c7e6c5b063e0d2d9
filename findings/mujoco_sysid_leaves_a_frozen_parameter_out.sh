#!/usr/bin/env bash
# mujoco 4.0.0 (extra sysid), CPython 3.11: a parameter that is frozen at its known value is not put into the model.
#
# One freezes what is known, such as a friction that was measured, so that the fit finds the rest. mujoco.sysid then
# does not call the parameter's modifier at all: neither in the fit nor in `apply_param_modifiers`. The model keeps the
# file's number, the reports show the frozen one, and the error is shifted into the parameters that are free. Nothing is
# said. Remedy: write known values into the spec, or give them bounds that are nearly equal.
#
# Seen: a hinge with an inertia of 0.20 kg m2 and a damping of 0.30; the file says 0.10 and 0.05. With the damping free
# the fit finds 0.20. With it frozen at the true 0.30 it finds 0.73, and the model has a damping of 0.05; with bounds of
# 0.2999 and 0.3001 it finds 0.20 again.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet 'mujoco[sysid]==4.0.0' numpy==2.4.6 scipy==1.17.1

cat > "$folder/fit.py" << 'PYTHON'
import mujoco
import numpy as np
from mujoco import sysid

MJCF = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody><body name="arm">
<joint name="hinge" damping="{damping}"/><inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>
</body></worldbody><actuator><motor joint="hinge"/></actuator><sensor><jointpos joint="hinge"/></sensor></mujoco>"""

truth = mujoco.MjModel.from_xml_string(MJCF.format(damping=0.3, inertia=0.2))
data = mujoco.MjData(truth)
times = 0.002 * np.arange(2001)
control = np.random.default_rng(0).uniform(-1.0, 1.0, (len(times), 1))
angles = []
for u in control:
    data.ctrl[:] = u
    mujoco.mj_forward(truth, data)
    angles.append(data.sensordata.copy())
    mujoco.mj_step(truth, data)


def set_inertia(spec, parameter):
    spec.body("arm").inertia = np.full(3, parameter.value.item())


def set_damping(spec, parameter):
    spec.joint("hinge").damping[0] = parameter.value.item()


def fit(low, high, frozen=False):
    """Return the inertia that is found, and the damping of the model that results."""
    spec = mujoco.MjSpec.from_string(MJCF.format(damping=0.05, inertia=0.1))
    model = spec.compile()
    parameters = sysid.ParameterDict()
    parameters.add(sysid.Parameter("inertia", 0.1, 0.01, 1.0, modifier=set_inertia))
    parameters.add(sysid.Parameter("damping", 0.3, low, high, frozen=frozen, modifier=set_damping))
    log = sysid.ModelSequences(
        "hinge",
        spec,
        "log",
        sysid.create_initial_state(model, np.zeros(1)),
        sysid.TimeSeries(times, control),
        sysid.TimeSeries.from_names(times, np.array(angles), model),
    )
    residual = sysid.build_residual_fn(models_sequences=[log])
    best, _ = sysid.optimize(initial_params=parameters, residual_fn=residual, optimizer="mujoco", verbose=False)
    fresh = mujoco.MjSpec.from_string(MJCF.format(damping=0.05, inertia=0.1))
    found = sysid.apply_param_modifiers(best, fresh)
    return f"{best['inertia'].value.item():.2f}:{found.dof_damping.item():.2f}"


print(fit(0.01, 1.0), fit(0.01, 1.0, frozen=True), fit(0.2999, 0.3001))
PYTHON

found=$("$folder/venv/bin/python" "$folder/fit.py" 2> /dev/null | tail -1)
echo "inertia:damping found with the damping free, frozen, between narrow bounds: $found"
[ "$found" = "0.20:0.30 0.73:0.05 0.20:0.30" ]
