"""Schema names, always in the spelling of ROS 2: `sensor_msgs/msg/Image`, which is `sensor_msgs/Image` in ROS 1."""

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
POINT_CLOUD_OLD = "sensor_msgs/msg/PointCloud"
LIVOX = tuple(f"{package}/msg/CustomMsg" for package in ("livox_ros_driver", "livox_ros_driver2", "livox_interfaces"))
VELODYNE = "velodyne_msgs/msg/VelodyneScan"
OUSTER = tuple(f"{package}/msg/PacketMsg" for package in ("ouster_ros", "ouster_msgs", "ouster_sensor_msgs"))
FFMPEG_PACKET = "ffmpeg_image_transport_msgs/msg/FFMPEGPacket"
FOXGLOVE_VIDEO = "foxglove_msgs/msg/CompressedVideo"
COMPRESSED_CLOUD = "point_cloud_interfaces/msg/CompressedPointCloud2"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
TRANSFORMS_OLD = "tf/msg/tfMessage"
STRING = "std_msgs/msg/String"
GPS_FIX = "sensor_msgs/msg/NavSatFix"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORM = "geometry_msgs/msg/TransformStamped"


def schema_name(name: str) -> str:
    """The name in its ROS 2 spelling; names that are not `package/Type` stay as they are.

    IDL spells it `package::msg::Type`, DDS `package::msg::dds_::Type_`.
    """
    if "::msg::" in name:
        name = name.replace("::dds_::", "::").removesuffix("_").replace("::", "/")
    package, slash, kind = name.partition("/")
    return f"{package}/msg/{kind}" if slash and kind and "/" not in kind else name
