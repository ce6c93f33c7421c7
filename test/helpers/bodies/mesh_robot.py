"""A robot whose links are mesh files: a column, an arm on its top, and a hand that the arm can fold back into the column."""

from pathlib import Path

import numpy as np

from helpers.bodies.mesh_solids import box, joined, rod
from tracker_node.loaders.model.mesh_file import write_mesh
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.shapes.primitives import Mesh

COLUMN = (0.12, 0.12, 0.5)
JOINTS = """<joint name="shoulder" type="revolute"><parent link="column"/><child link="upper"/><origin xyz="0.1 0 0.5"/>
  <axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.3 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-2.8" upper="2.8"/></joint>
<joint name="turn" type="revolute"><parent link="fore"/><child link="hand"/><origin xyz="0.4 0 0"/>
  <axis xyz="1 0 0"/><limit lower="-3" upper="3"/></joint>"""
SOLIDS = {  # of the same robot without files; turned from z, along which cylinders lie, to x
    "column": '<origin xyz="0 0 0.25"/><geometry><box size="0.12 0.12 0.5"/></geometry>',
    "upper": '<origin xyz="0.15 0 0" rpy="0 1.5707963 0"/><geometry><cylinder radius="0.04" length="0.3"/></geometry>',
    "fore": '<origin xyz="0.2 0 0" rpy="0 1.5707963 0"/><geometry><cylinder radius="0.03" length="0.4"/></geometry>',
    "hand": '<origin xyz="0.05 0 0"/><geometry><box size="0.1 0.06 0.02"/></geometry>',
}


def mesh_links() -> dict[str, Mesh]:
    """Motors and tubes run through each other, as in the drawings that robots come from."""
    motor = rod(0.05, (0.0, -0.06, 0.0), (0.0, 0.06, 0.0))
    return {
        "column": joined(box(COLUMN, (0.0, 0.0, 0.25))),
        "upper": joined(motor, rod(0.04, (0.0, 0.0, 0.0), (0.3, 0.0, 0.0))),
        "fore": joined(rod(0.03, (0.0, 0.0, 0.0), (0.4, 0.0, 0.0)), rod(0.04, (0.0, -0.05, 0.0), (0.0, 0.05, 0.0))),
        "hand": joined(box((0.1, 0.06, 0.02), (0.05, 0.0, 0.0))),
    }


def of_meshes(folder: Path) -> ArticulatedModel:
    """Written with its mesh files, and loaded."""
    for name, mesh in mesh_links().items():
        write_mesh(mesh, folder / "meshes" / name)
    return _loaded(folder, {name: f'<geometry><mesh filename="meshes/{name}.obj"/></geometry>' for name in SOLIDS})


def of_solids(folder: Path) -> ArticulatedModel:
    return _loaded(folder, SOLIDS)


def _loaded(folder: Path, visuals: dict[str, str]) -> ArticulatedModel:
    links = "".join(f'<link name="{name}"><visual>{visual}</visual></link>' for name, visual in visuals.items())
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="folding">{links}{JOINTS}</robot>')
    return load_model(file)


def folded(model: ArticulatedModel, degrees: float) -> np.ndarray:
    """Joint angles with the elbow bent: by 140 degrees the hand is within the column."""
    angles = np.zeros(model.chain.n_axes)
    angles[model.chain.axis_index("elbow")] = np.deg2rad(degrees)
    return angles
