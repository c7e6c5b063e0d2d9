"""Type hashes equal those of ROS."""

from __future__ import annotations

import pytest

pytest.importorskip("rosbags")

from golem.errors import ConfigError
from golem.middleware.ros import codec

PUBLISHED = {
    "builtin_interfaces/msg/Time": "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
    "std_msgs/msg/Header": "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "rosgraph_msgs/msg/Clock": "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    "geometry_msgs/msg/TransformStamped": "0a241f87d04668d94099cbb5ba11691d5ad32c2f29682e4eb5653424bd275206",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "sensor_msgs/msg/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "sensor_msgs/msg/Image": "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    "sensor_msgs/msg/CompressedImage": "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "sensor_msgs/msg/CameraInfo": "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    "sensor_msgs/msg/PointCloud2": "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "sensor_msgs/msg/Range": "b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "unique_identifier_msgs/msg/UUID": "1b8e8aca958cbea28fe6ef60bf6c19b683c97a9ef60bb34752067d0f2f7ab437",
    "action_msgs/msg/GoalInfo": "6398fe763154554353930716b225947f93b672f0fb2e49fdd01bb7a7e37933e9",
    "service_msgs/msg/ServiceEventInfo": "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45",
    "action_msgs/srv/CancelGoal": "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
}
"""Hashes in the C sources that rosidl generated on Iron and Jazzy installations, as public repositories hold them:
the `__EXPECTED_HASH` of a type that another one uses, and `action_msgs__srv__CancelGoal__get_type_hash`. Those of Clock
and Range are from clients that talk to such installations."""
GENERATED = {
    "std_msgs/msg/Bool": "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "action_msgs/msg/GoalStatusArray": "6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
    "nav_msgs/msg/Path": "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b",
    "nav_msgs/msg/OccupancyGrid": "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7",
    "std_srvs/srv/Empty": "5888399dedec5ccc85ea6451949fd2c9f97bfdf963f9a588821639fcd31b5d19",
    "std_srvs/srv/SetBool": "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
    "std_srvs/srv/Trigger": "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "std_srvs/srv/Trigger_Request": "d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199",
    "std_srvs/srv/Trigger_Event": "ec4a1d26b0575e61906890342aba9523a2360e9845857c5590fa6e23bc39e1c2",
    "golem_interfaces/msg/SafetyStatus": "3e6f2ea0ceda6abe63052bbb7f17350439bc18d917bd4c396c67f5d493bfaee1",
    "golem_interfaces/action/Stand": "a98021c9de8561df2acb29a4ccfcef2dce28e958833ace26fe631a2e186cf424",
    "golem_interfaces/action/Stand_SendGoal": "c5dd3b7032a0747514f78bd560c9f6e79cf99206465b8a825b9398cec957d782",
    "golem_interfaces/action/Stand_GetResult": "ac5a39abbba49fdf02950e80cc7eb67a395a6de046ce4d15b11bce816a0a2ed1",
    "golem_interfaces/action/Stand_FeedbackMessage": "58a04c24a7b5dc860be1f038765be9fea8300b5cefdfd2455f2c42fe93bf8432",
    "unitree_hg/msg/LowState": "aee6c5bd4b4d2eeca854bf47e32e4e3d34c47c2cafa05c08b6b0fa4bc51c6b3a",
    "livox_ros_driver2/msg/CustomMsg": "2eb17e5e35bf5a2d6cd079f3c57f33abf95e5bf7d71b42cddc05daace73d815a",
}
"""Hashes computed by the official generator from the official .msg and .srv files, and from ours: rosidl_adapter,
rosidl_parser and rosidl_generator_type_description of ros2/rosidl 95739d5. It agrees with PUBLISHED."""


@pytest.mark.parametrize(("name", "expected"), [*PUBLISHED.items(), *GENERATED.items()])
def test_the_hash_is_the_one_that_ros_computes(name: str, expected: str) -> None:
    assert codec.type_hash(name) == f"RIHS01_{expected}"


def test_what_differs_between_distributions_has_another_hash() -> None:
    gid = "rmw_dds_common/msg/Gid"
    assert codec.codec("humble").type_hash(gid) != codec.codec("jazzy").type_hash(gid)
    pick = "golem_interfaces/action/Pick"
    assert codec.codec("humble").type_hash(pick) == codec.codec("jazzy").type_hash(pick)


def test_an_unknown_type_has_none() -> None:
    with pytest.raises(ConfigError, match="Did you mean 'std_msgs/msg/String'"):
        codec.type_hash("std_msgs/msg/Strin")
