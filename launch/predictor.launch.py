"""Start the predictor with one configuration.

ros2 launch ctcbs_ros predictor.launch.py params_file:=FILE

Where telemetry comes from topics (mavlink.url is empty), they are mavros's unless set otherwise.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue

TOPICS = {
    "fix": ("mavros/global_position/global", "Topic of the position (NavSatFix)"),
    "odom": (
        "mavros/local_position/odom",
        "Topic of the velocity, and of the position without fix (Odometry)",
    ),
    "pose": (
        "mavros/local_position/pose",
        "Topic of the position where there is neither of these (PoseStamped)",
    ),
    "velocity": (
        "mavros/local_position/velocity_local",
        "Topic of the velocity where there is no odometry (TwistStamped, ENU)",
    ),
    "wind": (
        "mavros/wind_estimation",
        "Topic of the wind, where the air moves to (TwistWithCovarianceStamped, ENU)",
    ),
}


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                description="Configuration of cable, end mass and flight; no default, because "
                "the prediction for another cable is wrong and does not look it",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="Namespace"),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", description="Take time from /clock"
            ),
            DeclareLaunchArgument(
                "log_level", default_value="info", description="debug, info, warn, error or fatal"
            ),
            *(
                DeclareLaunchArgument(name, default_value=topic, description=description)
                for name, (topic, description) in TOPICS.items()
            ),
            Node(
                package="ctcbs_ros",
                executable="predictor",
                name="predictor",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    ParameterFile(LaunchConfiguration("params_file")),
                    {
                        "use_sim_time": ParameterValue(
                            LaunchConfiguration("use_sim_time"), value_type=bool
                        )
                    },
                ],
                remappings=[
                    (topic, LaunchConfiguration(name)) for name, (topic, _) in TOPICS.items()
                ],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                output="screen",
            ),
        ]
    )
