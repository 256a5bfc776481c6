from glob import glob

from setuptools import find_packages, setup

NAME = "ctcbs_ros"
SHARE = f"share/{NAME}"

# Real ROS 2 (Jazzy) as wheels, for machines without a ROS installation.
ROS = [
    "ros-rclpy[fastrtps]==7.1.6",
    "ros-jazzy-rclpy==7.1.6",
    "ros-std-msgs==5.3.6",
    "ros-geometry-msgs==5.3.6",
    "ros-sensor-msgs==5.3.6",
    "ros-nav-msgs==5.3.6",
    "ros-diagnostic-msgs==5.3.6",
    "ros-visualization-msgs==5.3.6",
]
TEST = [
    "pytest>=8",
    "pytest-xdist>=3.5",
    "ruff>=0.14",
    "hypothesis>=6.100",
    "moordyn>=2.4",
    # `colcon build` of a Python package; colcon needs setuptools below 80
    "colcon-core>=0.20",
    "colcon-ros>=0.5",
    "setuptools>=70.1,<80",
]

setup(
    name=NAME,
    version="0.1.0",
    description="Prediction of the end mass of a cable towed by a circling aircraft",
    license="Apache-2.0",
    maintainer="ctcbs_ros maintainers",
    maintainer_email="maintainers@ctcbs-ros.invalid",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={f"{NAME}.bench": ["*.c"]},
    python_requires=">=3.10",
    install_requires=[
        "numpy>=1.26",
        "scipy>=1.11",
        "numba>=0.59",
        "pymavlink>=2.4.41",
        "pymap3d>=3.1",
        "pyulog>=1.3",
        "rosbags>=0.11.9",
        "threadpoolctl>=3.1",
        "PyYAML>=6.0",
        "tqdm>=4.64",
        "matplotlib>=3.6",
    ],
    extras_require={"ros": ROS, "serial": ["pyserial>=3.5"], "test": TEST},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/config", sorted(glob("config/*.yaml"))),
        (f"{SHARE}/launch", sorted(glob("launch/*.launch.py"))),
        (f"{SHARE}/msg_examples", sorted(glob("msg_examples/*.yaml"))),
    ],
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "ctcbs = ctcbs_ros.cli.main:main",
            "predictor = ctcbs_ros.nodes.predictor:main",
        ],
    },
)
