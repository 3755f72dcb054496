"""Tolerances of the block solver, each relative to what it is compared with. Four levels serve all its parts.

Answers do not depend on them: each separates quantities that differ by orders of magnitude. Round-off of coordinates is in
`roundoff`; settings of the contact solver are in `ContactSolver`.
"""

import math

#: Two numbers are the same that differ by less: strengths and the forces that reach them, areas of blocks, a vertex on an
#: edge. Round-off of forces and areas is some 1e-12.
SAME = 1e-9
#: Too small to matter: an inertia force or a contact force beside the loads on a block, a tributary length beside its
#: edge, the sine of the angle at a flat vertex, a gap between faces beside the whole drawing.
NOTHING = 1e-6
#: Small enough to be left out of account: slip, and what a toe carries, beside those of the whole block.
LITTLE = 1e-3
#: Large enough to be reported, and to be treated as another case: energy gained, strain, forces that round-off causes, a
#: length missing in a face.
NOTABLE = 1e-2
#: Faces whose directions differ by less than this are one face, and a motion inclined by less is along it.
ONE_FACE_DEG = 3.0
ONE_FACE_COS, ONE_FACE_SIN = math.cos(math.radians(ONE_FACE_DEG)), math.sin(math.radians(ONE_FACE_DEG))
