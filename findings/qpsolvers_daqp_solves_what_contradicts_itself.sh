#!/usr/bin/env bash
# qpsolvers 4.13.0, daqp 0.11.0, CPython 3.11: equalities that contradict each other are reported as solved.
#
# Inverse kinematics and whole-body control ask for contacts and loops as equalities, and expect "no solution" where two
# of them cannot both hold. qpsolvers gives DAQP an equality as an upper bound with no lower one. DAQP then keeps the
# rows that fit, forgets the others and returns 1, "optimal". Asked with both bounds it returns -6, and the five other
# solvers that were tried find nothing. Look at `primal_residual()` before `found`.
#
# Seen: x = 0 and x = 1 together: DAQP by qpsolvers is found, off by 1.0; ProxQP, quadprog, PIQP, Clarabel and OSQP are
# not. DAQP by itself says 1 without lower bounds and -6 with them.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet qpsolvers==4.13.0 daqp==0.11.0 \
    clarabel==0.11.1 osqp==1.1.3 piqp==0.7.0 proxsuite==0.8.0 quadprog==0.1.14 scipy==1.17.1 \
    numpy==2.4.6

cat > "$folder/solve.py" << 'PYTHON'
import warnings

import daqp
import numpy as np
import qpsolvers

warnings.simplefilter("ignore")
H, f = np.eye(2), np.array([-3.0, -4.0])
A, b = np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([0.0, 1.0])

asked = qpsolvers.Problem(H, f, A=A, b=b)
solution = qpsolvers.solve_problem(asked, solver="daqp")
print(solution.found, solution.primal_residual(), end=" ")
for solver in ("proxqp", "quadprog", "piqp", "clarabel", "osqp"):
    print(qpsolvers.solve_problem(asked, solver=solver).found, end=" ")
for lower in (np.full(2, -1e30), b.copy()):
    print(daqp.solve(H, f, A, b.copy(), lower, np.full(2, 5, np.int32))[2], end=" ")
PYTHON

found=$("$folder/venv/bin/python" "$folder/solve.py")
echo "DAQP found, off by; the five others found; DAQP's flag without and with lower bounds: $found"
[ "$found" = "True 1.0 False False False False False 1 -6 " ]
