"""Builds the ament_python package: by colcon on a ROS 2 installation, by pip with ROS from PyPI."""

from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "tracker_node"
ROOT = Path(__file__).parent
EXECUTABLES = [
    "camera_ingest", "compose", "keypoints", "pipeline", "player", "recorder", "rectify", "rerun_bridge", "tracker", PACKAGE,
]  # fmt: skip

RUNTIME_REQUIREMENTS = [
    "argcomplete>=3.0",
    "ezc3d>=1.5",
    "fast-simplification>=0.1.9",
    "fpdf2>=2.8",
    "jinja2>=3.1",
    "lz4>=4.0",
    "mannequin-x>=0.3",
    "matplotlib>=3.6",
    "mcap>=1.5",
    "numba>=0.59",
    "numpy>=2.0",
    "opencv-python-headless>=4.8",
    "pycollada>=0.8",
    "pydantic>=2.0",
    "pyrender-maintained>=1.0",
    "pyyaml>=6.0",
    "rosbags>=0.11,<0.12",
    "scipy>=1.11",
    "threadpoolctl>=3.1",
    "trimesh>=4.0",
    "zstandard>=0.20",
]
# Extras: what only one part needs, which says so where it is missing (`errors.extra_module`).
STUDIO_REQUIREMENTS = ["starlette>=0.40", "uvicorn>=0.30", "websockets>=13.0"]
KEYPOINTS_REQUIREMENTS = ["ai-edge-litert>=2.3"]
H5_REQUIREMENTS = ["h5py>=3.9"]
DATA_REQUIREMENTS = ["pandas>=2.2", "xarray>=2024.1"]
CLUSTER_REQUIREMENTS = ["distributed>=2024.1"]
SOUND_REQUIREMENTS = ["av>=14.0"]
RERUN_REQUIREMENTS = ["rerun-sdk>=0.41"]
OPENSIM_REQUIREMENTS = ["opensim>=4.5"]
DOCS_REQUIREMENTS = ["furo", "myst-parser", "sphinx"]
# Only where ROS does not come from apt.
ROS_REQUIREMENTS = ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces"]
TEST_REQUIREMENTS = [
    "bvhio",
    "c3d",
    "cmeel-urdfdom",
    "codespell",
    "foxglove-sdk",
    "geomdl",
    "hypothesis",
    "import-linter",
    "ipykernel",
    "kinpy",
    "mypy",
    "nbclient",
    "numpydoc",
    "playwright",
    "pypdf",
    "pytest",
    "pytest-timeout",
    "pytest-xdist",
    "ruff",
]

CLASSIFIERS = [
    "Development Status :: 4 - Beta",
    "Environment :: Console",
    "Intended Audience :: Science/Research",
    "License :: OSI Approved :: Apache Software License",
    "Operating System :: POSIX :: Linux",
    "Programming Language :: Python :: 3",
    "Programming Language :: Python :: 3.11",
    "Programming Language :: Python :: 3.12",
    "Topic :: Scientific/Engineering :: Image Recognition",
    "Typing :: Typed",
]

DATA_SUFFIXES = ["css", "html", "j2", "js", "json", "msg", "svg", "xml", "yaml"]


def installed_tree(folder: str) -> list[tuple[str, list[str]]]:
    """The files under `folder`, as data_files below share/<package>."""
    files = sorted(path.relative_to(ROOT) for path in (ROOT / folder).rglob("*") if path.is_file())
    files = [path for path in files if "__pycache__" not in path.parts]
    return [
        (f"share/{PACKAGE}/{parent}", [str(path) for path in files if path.parent == parent])
        for parent in sorted({path.parent for path in files})
    ]


setup(
    name=PACKAGE,
    version="0.2.0",
    description="Markerless model-based 3D motion tracking from several calibrated cameras, for ROS 2",
    long_description=(ROOT / "README.md").read_text() if (ROOT / "README.md").exists() else "",
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    keywords=["motion capture", "markerless", "pose tracking", "multi-camera", "biomechanics", "ROS 2"],
    classifiers=CLASSIFIERS,
    project_urls={  # what is public: a repository has no address yet
        "Paper (extremal contours)": "https://doi.org/10.1007/11612032_67",
        "License": "https://www.apache.org/licenses/LICENSE-2.0",
    },
    maintainer="tracker_node maintainers",
    maintainer_email="tracker_node@example.org",
    python_requires=">=3.11,<3.13",
    packages=find_packages(include=[f"{PACKAGE}*"]),
    package_data={PACKAGE: ["py.typed", *(f"**/*.{suffix}" for suffix in DATA_SUFFIXES)]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        # `ros2 run` looks here. pip puts console scripts into bin/, and a script made by colcon is tied to
        # the Python that ran colcon; these follow the environment in use.
        (f"lib/{PACKAGE}", [f"resource/executables/{name}" for name in EXECUTABLES]),
        *installed_tree("config"),
        *installed_tree("launch"),
    ],
    install_requires=["setuptools", *RUNTIME_REQUIREMENTS],
    extras_require={
        "ros": ROS_REQUIREMENTS,
        "studio": STUDIO_REQUIREMENTS,
        "keypoints": KEYPOINTS_REQUIREMENTS,
        "h5": H5_REQUIREMENTS,
        "data": DATA_REQUIREMENTS,
        "cluster": CLUSTER_REQUIREMENTS,
        "sound": SOUND_REQUIREMENTS,
        "rerun": RERUN_REQUIREMENTS,
        "opensim": OPENSIM_REQUIREMENTS,
        "docs": DOCS_REQUIREMENTS,
        "test": [
            *TEST_REQUIREMENTS,
            *STUDIO_REQUIREMENTS,
            *KEYPOINTS_REQUIREMENTS,
            *H5_REQUIREMENTS,
            *DATA_REQUIREMENTS,
            *CLUSTER_REQUIREMENTS,
            *SOUND_REQUIREMENTS,
            *RERUN_REQUIREMENTS,
            *OPENSIM_REQUIREMENTS,
            *DOCS_REQUIREMENTS,
        ],
    },
    entry_points={"console_scripts": [f"{PACKAGE} = {PACKAGE}.cli.main:main"]},
    zip_safe=True,
)
