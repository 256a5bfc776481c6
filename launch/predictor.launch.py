"""Start the predictor with one configuration.

ros2 launch ctcbs_ros predictor.launch.py params_file:=FILE

Where telemetry comes from topics (mavlink.url is empty), they are mavros's unless set otherwise.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue


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
            DeclareLaunchArgument(
                "fix",
                default_value="mavros/global_position/global",
                description="Topic of the position (NavSatFix)",
            ),
            DeclareLaunchArgument(
                "odom",
                default_value="mavros/local_position/odom",
                description="Topic of the velocity, and of the position without fix (Odometry)",
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
                    ("fix", LaunchConfiguration("fix")),
                    ("odom", LaunchConfiguration("odom")),
                ],
                arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
                output="screen",
            ),
        ]
    )
