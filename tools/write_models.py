"""Write the bodies of tracker_node/model/ that come as files into config/models/, with where their numbers come from."""

from pathlib import Path

from tracker_node.experiments.cross.throw import yellow_stick
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.model.humans.segments18 import ellipsoid_human, nurbs_human

FOLDER = Path(__file__).resolve().parents[1] / "config" / "models"
BODY = """18 segments, 17 ball joints, 57 variables: the body of Trewartha, Yeadon & Knight (Colour based rigid body tracking
using three-dimensional graphics models). Root: the top of the pelvis. Units: meters, degrees. Format: docs/formats.md.
Joint centers and girths: subject "male3" of the Python package yeadon 2.0.1 (BSD), measured for Yeadon's inertia model
(J. Biomech. 23, 1990, 67-74), left and right averaged. Limits: at least the norms of the American Academy of Orthopaedic
Surgeons (1965).
"""
COMMENTS = {
    nurbs_human: f"""nurbs_human, a measured man of 1.81 m.
{BODY}Each segment is a bicubic B-spline surface through stadium cross-sections (Yeadon's levels), closed by domes.
Written by tools/write_models.py; tracker_node/model/humans/segments18.py explains the numbers.""",
    ellipsoid_human: f"""ellipsoid_human, a man of 1.81 m.
{BODY}Each ellipsoid has the center and the second moments of the segment of nurbs_human; docs/bodies.md says how they differ.
Written by tools/write_models.py from tracker_node/model/humans/segments18.py.""",
    yellow_stick: """The YellowStick of Trewartha, Yeadon & Knight: a bright yellow cross of two wooden prisms. The paper gives no
dimensions; these are ours, with four unequal arms so that its pose is unique (tracker_node/experiments/cross/throw.py).
Units: meters. Format: docs/formats.md. Written by tools/write_models.py.""",
}

if __name__ == "__main__":
    for make, comment in COMMENTS.items():
        model = make()
        dump_model(model, FOLDER / f"{model.name}.yaml", comment)
